"""A real bench: a stage that G-code moves, and a converter that samples the whiskers.

bench.toml --read_bench--> Bench --open--> BenchSession --feel(pass)--> Sweep      (the protocol of `StageSession`)
                             |
                             +-- Controller: Grbl | Marlin        moves, over a serial port
                             +-- LineDaq | NiDaq                  samples, over a serial port or by NI-DAQmx
"""
