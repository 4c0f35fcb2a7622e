"""A bench of iron: a stage that is moved by G-code, a converter that samples the whiskers, and emulators of both.

bench.toml --read_bench--> Bench --open--> BenchSession --feel(pass)--> Sweep      (the protocol of `StageSession`)
                             |
                             +-- Controller: Grbl | Marlin        moves, over a serial port
                             +-- Daq: LineDaq | NiDaq             samples, over a serial port or by NI-DAQmx
"""
