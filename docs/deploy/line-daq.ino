// The line protocol of docs/pages/reference/daq-line-protocol.md, for an Arduino core. Never run on a board.
const int CHANNELS = 8, SYNC_PIN = 2;
bool on = false; uint32_t number = 0, period_us = 400, next_us = 0;
char text[160];

void readCounts(int16_t *counts) { /* your converter: 16 bits a channel, within period_us */ }

uint16_t crc16(const char *s, int n) {
  uint16_t crc = 0;
  for (int i = 0; i < n; i++) {
    crc ^= (uint16_t)(uint8_t)s[i] << 8;
    for (int b = 0; b < 8; b++) crc = crc & 0x8000 ? (crc << 1) ^ 0x1021 : crc << 1;
  }
  return crc;
}

void hello() { Serial.println("tactile-daq 1 8 16 10.0 sketch"); }

void setup() { Serial.begin(2000000); Serial.setTimeout(5); pinMode(SYNC_PIN, INPUT); hello(); }

void answer(String line) {
  line.trim();
  if (line == "id") hello();
  else if (line.startsWith("rate ")) {
    period_us = lround(1e6 / line.substring(5).toFloat());
    Serial.print("ok "); Serial.println(1e6 / period_us, 2);
  }
  else if (line == "start") { Serial.println("ok"); number = 0; next_us = micros() + period_us; on = true; }
  else if (line == "stop") { on = false; Serial.print("ok "); Serial.println(number); }
  else Serial.println("error no such command");
}

void loop() {
  if (Serial.available()) answer(Serial.readStringUntil('\n'));
  if (!on || (int32_t)(micros() - next_us) < 0) return;
  int16_t counts[CHANNELS];
  int sync = digitalRead(SYNC_PIN);
  readCounts(counts);
  int n = snprintf(text, sizeof text, "%lu %d", (unsigned long)number, sync);
  for (int c = 0; c < CHANNELS; c++) n += snprintf(text + n, sizeof text - n, " %d", counts[c]);
  snprintf(text + n, sizeof text - n, " %04X", crc16(text, n));
  Serial.println(text);
  // a sample that comes too late leaves numbers out
  do { number++; next_us += period_us; } while ((int32_t)(micros() - next_us) > (int32_t)period_us);
}
