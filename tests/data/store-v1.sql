BEGIN TRANSACTION;
CREATE TABLE alerts (
	name TEXT NOT NULL, 
	part_id VARCHAR(26) NOT NULL, 
	at DATETIME NOT NULL, 
	message TEXT NOT NULL, 
	CONSTRAINT pk_alerts PRIMARY KEY (name), 
	CONSTRAINT fk_alerts_part_id FOREIGN KEY(part_id) REFERENCES parts (id)
);
CREATE TABLE events (
	id INTEGER NOT NULL, 
	part_id VARCHAR(26) NOT NULL, 
	at DATETIME NOT NULL, 
	kind VARCHAR(32) NOT NULL, 
	actor TEXT, 
	seconds DOUBLE, 
	data JSON NOT NULL, 
	CONSTRAINT pk_events PRIMARY KEY (id), 
	CONSTRAINT fk_events_part_id FOREIGN KEY(part_id) REFERENCES parts (id)
);
INSERT INTO "events" VALUES(1,'01M8BJHN15C3V8MZGY4GKX11GT','2026-11-21 09:30:00.000000','received',NULL,NULL,'{"name":"plate 1","expected":"KX4","database":"","job":"","line":""}');
INSERT INTO "events" VALUES(2,'01M8BJHN15C3V8MZGY4GKX11GT','2026-11-21 09:30:00.000000','read','vision',0.4,'{"source":"vision","text":"KX4","decision":"accept","confidence":0.93,"characters":[{"candidates":[{"char":"K","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[0.0,0.0,0.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"X","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[1.0,0.0,1.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"4","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[2.0,0.0,2.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null}],"messages":["a word","Gr\u00f6\u00dfe"],"font":"gothic","height_mm":5.0,"rotation_deg":0.2,"verdict":"","database":"","seconds":0.4,"at":"2026-11-21T09:30:00Z","part":"","error":"","height_px":null,"raised":false,"expected":"","verify_probability":null,"rivals":[],"lines":[],"codes":[],"fields":[],"program":"","settings":"","photos":0,"passes":[],"stage_s":null,"stopped":"","faults":[]}');
INSERT INTO "events" VALUES(3,'01M8BJHP1SE9SZH9KV07MDH4DG','2026-11-21 09:30:02.500000','received',NULL,NULL,'{"name":"Gr\u00f6\u00dfe","expected":"","database":"","job":"","line":""}');
INSERT INTO "events" VALUES(4,'01M8BJHP1SE9SZH9KV07MDH4DG','2026-11-21 09:30:02.500000','read','vision',0.4,'{"source":"vision","text":"KXO","decision":"review","confidence":0.93,"characters":[{"candidates":[{"char":"K","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[0.0,0.0,0.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"X","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[1.0,0.0,1.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"O","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[2.0,0.0,2.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null}],"messages":["a word","Gr\u00f6\u00dfe"],"font":"gothic","height_mm":5.0,"rotation_deg":0.2,"verdict":"","database":"","seconds":0.4,"at":"2026-11-21T09:30:02.500000Z","part":"","error":"","height_px":null,"raised":false,"expected":"","verify_probability":null,"rivals":[],"lines":[],"codes":[],"fields":[],"program":"","settings":"","photos":0,"passes":[],"stage_s":null,"stopped":"","faults":[]}');
INSERT INTO "events" VALUES(5,'01M8BJHP1SE9SZH9KV07MDH4DG','2026-11-21 09:30:02.500000','touch_needed',NULL,NULL,'{"reason":"the camera is unsure","seconds":7.5}');
INSERT INTO "events" VALUES(6,'01M8BJHP1SE9SZH9KV07MDH4DG','2026-11-21 09:30:10.500001','read','fused',0.4,'{"source":"fused","text":"KX0","decision":"review","confidence":0.93,"characters":[{"candidates":[{"char":"K","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[0.0,0.0,0.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"X","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[1.0,0.0,1.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"0","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[2.0,0.0,2.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null}],"messages":["a word","Gr\u00f6\u00dfe"],"font":"gothic","height_mm":5.0,"rotation_deg":0.2,"verdict":"","database":"","seconds":0.4,"at":"2026-11-21T09:30:10.500001Z","part":"","error":"","height_px":null,"raised":false,"expected":"","verify_probability":null,"rivals":[],"lines":[],"codes":[],"fields":[],"program":"","settings":"","photos":0,"passes":[],"stage_s":null,"stopped":"","faults":[]}');
INSERT INTO "events" VALUES(7,'01M8BJHP1SE9SZH9KV07MDH4DG','2026-11-21 09:33:10.500001','reviewed',NULL,NULL,'{"action":"correct","before":"KX0","after":"KX9","who":"Ada","token":"","note":"rust","at":"2026-11-21T09:33:10.500001Z"}');
INSERT INTO "events" VALUES(8,'01M8BJHPH9T86XC5Q4DM0N0REB','2026-11-21 09:33:10.500001','received',NULL,NULL,'{"name":"plate 3","expected":"","database":"","job":"","line":"press"}');
INSERT INTO "events" VALUES(9,'01M8BJHPH9T86XC5Q4DM0N0REB','2026-11-21 09:33:10.500001','read','vision',0.4,'{"source":"vision","text":"K8","decision":"review","confidence":0.93,"characters":[{"candidates":[{"char":"K","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[0.0,0.0,0.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"8","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[1.0,0.0,1.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null}],"messages":["a word","Gr\u00f6\u00dfe"],"font":"gothic","height_mm":5.0,"rotation_deg":0.2,"verdict":"","database":"","seconds":0.4,"at":"2026-11-21T09:33:10.500001Z","part":"","error":"","height_px":null,"raised":false,"expected":"","verify_probability":null,"rivals":[],"lines":[],"codes":[],"fields":[],"program":"","settings":"","photos":0,"passes":[],"stage_s":null,"stopped":"","faults":[]}');
INSERT INTO "events" VALUES(10,'01M8BJHPH9T86XC5Q4DM0N0REB','2026-11-21 09:33:10.500001','touch_needed',NULL,NULL,'{"reason":"the camera is unsure","seconds":7.5}');
CREATE TABLE evidence (
	id INTEGER NOT NULL, 
	part_id VARCHAR(26) NOT NULL, 
	at DATETIME NOT NULL, 
	kind VARCHAR(32) NOT NULL, 
	sha256 VARCHAR(64) NOT NULL, 
	n_bytes BIGINT NOT NULL, 
	name TEXT NOT NULL, 
	media_type TEXT NOT NULL, 
	meta JSON NOT NULL, 
	gone BOOLEAN NOT NULL, 
	CONSTRAINT pk_evidence PRIMARY KEY (id), 
	CONSTRAINT fk_evidence_part_id FOREIGN KEY(part_id) REFERENCES parts (id)
);
INSERT INTO "evidence" VALUES(1,'01M8BJHN15C3V8MZGY4GKX11GT','2026-11-21 09:30:00.000000','photo','aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa',1000,'part 1.png','image/png','{"mm_per_pixel":0.05}',0);
INSERT INTO "evidence" VALUES(2,'01M8BJHP1SE9SZH9KV07MDH4DG','2026-11-21 09:30:02.500000','photo','cccccccccccccccccccccccccccccccccccccccccccccccccccccccccccccccc',1000,'part 1.png','image/png','{"mm_per_pixel":0.05}',0);
INSERT INTO "evidence" VALUES(3,'01M8BJHP1SE9SZH9KV07MDH4DG','2026-11-21 09:30:10.500001','scan','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb',2000,'part 1.h5','application/octet-stream','{}',0);
CREATE TABLE golden (
	id INTEGER NOT NULL, 
	line TEXT NOT NULL, 
	reference BOOLEAN NOT NULL, 
	record JSON NOT NULL, 
	CONSTRAINT pk_golden PRIMARY KEY (id)
);
CREATE TABLE idempotency (
	key_hash VARCHAR(64) NOT NULL, 
	fingerprint TEXT NOT NULL, 
	part_id VARCHAR(26) NOT NULL, 
	at DATETIME NOT NULL, 
	CONSTRAINT pk_idempotency PRIMARY KEY (key_hash), 
	CONSTRAINT fk_idempotency_part_id FOREIGN KEY(part_id) REFERENCES parts (id)
);
INSERT INTO "idempotency" VALUES('79dbca15bce384000d0a59f0e96d6700258c71983a5af165f01650d524218427','f','01M8BJHN15C3V8MZGY4GKX11GT','2026-11-21 09:30:00.000000');
CREATE TABLE outbox (
	id INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, 
	part_id VARCHAR(26) NOT NULL, 
	target VARCHAR(32) NOT NULL, 
	payload JSON NOT NULL, 
	attempts INTEGER NOT NULL, 
	error TEXT NOT NULL, 
	created_at DATETIME NOT NULL, 
	due_at DATETIME NOT NULL, 
	owner VARCHAR(32), 
	leased_until DATETIME, 
	CONSTRAINT fk_outbox_part_id FOREIGN KEY(part_id) REFERENCES parts (id)
);
INSERT INTO "outbox" VALUES(1,'01M8BJHN15C3V8MZGY4GKX11GT','mqtt','{"id":"01M8BJHN15C3V8MZGY4GKX11GT","name":"plate 1","state":"accepted","text":"KX4","created_at":"2026-11-21T09:30:00Z","changed_at":"2026-11-21T09:30:00Z","reading":{"source":"vision","text":"KX4","decision":"accept","confidence":0.93,"characters":[{"candidates":[{"char":"K","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[0.0,0.0,0.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"X","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[1.0,0.0,1.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"4","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[2.0,0.0,2.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null}],"messages":["a word","Gr\u00f6\u00dfe"],"font":"gothic","height_mm":5.0,"rotation_deg":0.2,"verdict":"","database":"","seconds":0.4,"at":"2026-11-21T09:30:00Z","part":"","error":"","height_px":null,"raised":false,"expected":"","verify_probability":null,"rivals":[],"lines":[],"codes":[],"fields":[],"program":"","settings":"","photos":0,"passes":[],"stage_s":null,"stopped":"","faults":[]},"expected":"KX4","database":"","job":"","line":"","plan":null,"touch":null,"review":null,"shadow":null}',0,'','2026-11-21 09:30:00.000000','1970-01-01 00:00:00.000000',NULL,NULL);
INSERT INTO "outbox" VALUES(2,'01M8BJHP1SE9SZH9KV07MDH4DG','mqtt','{"id":"01M8BJHP1SE9SZH9KV07MDH4DG","name":"Gr\u00f6\u00dfe","state":"review","text":"KX0","created_at":"2026-11-21T09:30:02.500000Z","changed_at":"2026-11-21T09:30:10.500001Z","reading":{"source":"fused","text":"KX0","decision":"review","confidence":0.93,"characters":[{"candidates":[{"char":"K","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[0.0,0.0,0.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"X","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[1.0,0.0,1.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"0","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[2.0,0.0,2.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null}],"messages":["a word","Gr\u00f6\u00dfe"],"font":"gothic","height_mm":5.0,"rotation_deg":0.2,"verdict":"","database":"","seconds":0.4,"at":"2026-11-21T09:30:10.500001Z","part":"","error":"","height_px":null,"raised":false,"expected":"","verify_probability":null,"rivals":[],"lines":[],"codes":[],"fields":[],"program":"","settings":"","photos":0,"passes":[],"stage_s":null,"stopped":"","faults":[]},"expected":"","database":"","job":"","line":"","plan":null,"touch":null,"review":null,"shadow":null}',0,'','2026-11-21 09:30:10.500001','1970-01-01 00:00:00.000000',NULL,NULL);
INSERT INTO "outbox" VALUES(3,'01M8BJHP1SE9SZH9KV07MDH4DG','mqtt','{"id":"01M8BJHP1SE9SZH9KV07MDH4DG","name":"Gr\u00f6\u00dfe","state":"reviewed","text":"KX9","created_at":"2026-11-21T09:30:02.500000Z","changed_at":"2026-11-21T09:33:10.500001Z","reading":{"source":"fused","text":"KX0","decision":"review","confidence":0.93,"characters":[{"candidates":[{"char":"K","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[0.0,0.0,0.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"X","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[1.0,0.0,1.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"0","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[2.0,0.0,2.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null}],"messages":["a word","Gr\u00f6\u00dfe"],"font":"gothic","height_mm":5.0,"rotation_deg":0.2,"verdict":"","database":"","seconds":0.4,"at":"2026-11-21T09:30:10.500001Z","part":"","error":"","height_px":null,"raised":false,"expected":"","verify_probability":null,"rivals":[],"lines":[],"codes":[],"fields":[],"program":"","settings":"","photos":0,"passes":[],"stage_s":null,"stopped":"","faults":[]},"expected":"","database":"","job":"","line":"","plan":null,"touch":null,"review":{"action":"correct","before":"KX0","after":"KX9","who":"Ada","token":"","note":"rust","at":"2026-11-21T09:33:10.500001Z"},"shadow":null}',0,'','2026-11-21 09:33:10.500001','1970-01-01 00:00:00.000000',NULL,NULL);
CREATE TABLE parts (
	id VARCHAR(26) NOT NULL, 
	state VARCHAR(16) NOT NULL, 
	created_at DATETIME NOT NULL, 
	changed_at DATETIME NOT NULL, 
	name_folded TEXT NOT NULL, 
	text_folded TEXT NOT NULL, 
	job TEXT NOT NULL, 
	line TEXT NOT NULL, 
	touch_by_stage BOOLEAN, 
	touch_until DATETIME, 
	fell_back BOOLEAN NOT NULL, 
	by_camera BOOLEAN NOT NULL, 
	rejected BOOLEAN NOT NULL, 
	was_right BOOLEAN, 
	characters INTEGER, 
	characters_right INTEGER, 
	agreement VARCHAR(16), 
	would_be VARCHAR(16), 
	audit VARCHAR(16), 
	claim_holder TEXT, 
	claim_who TEXT, 
	claim_until DATETIME, 
	record JSON NOT NULL, 
	CONSTRAINT pk_parts PRIMARY KEY (id)
);
INSERT INTO "parts" VALUES('01M8BJHN15C3V8MZGY4GKX11GT','accepted','2026-11-21 09:30:00.000000','2026-11-21 09:30:00.000000','plate 1','kx4','','',NULL,NULL,0,1,0,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL,'{"id":"01M8BJHN15C3V8MZGY4GKX11GT","name":"plate 1","state":"accepted","text":"KX4","created_at":"2026-11-21T09:30:00Z","changed_at":"2026-11-21T09:30:00Z","reading":{"source":"vision","text":"KX4","decision":"accept","confidence":0.93,"characters":[{"candidates":[{"char":"K","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[0.0,0.0,0.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"X","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[1.0,0.0,1.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"4","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[2.0,0.0,2.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null}],"messages":["a word","Gr\u00f6\u00dfe"],"font":"gothic","height_mm":5.0,"rotation_deg":0.2,"verdict":"","database":"","seconds":0.4,"at":"2026-11-21T09:30:00Z","part":"","error":"","height_px":null,"raised":false,"expected":"","verify_probability":null,"rivals":[],"lines":[],"codes":[],"fields":[],"program":"","settings":"","photos":0,"passes":[],"stage_s":null,"stopped":"","faults":[]},"expected":"KX4","database":"","job":"","line":"","plan":null,"touch":null,"review":null,"shadow":null}');
INSERT INTO "parts" VALUES('01M8BJHP1SE9SZH9KV07MDH4DG','reviewed','2026-11-21 09:30:02.500000','2026-11-21 09:33:10.500001','grösse','kx9','','',NULL,NULL,1,0,0,0,3,2,NULL,NULL,NULL,NULL,NULL,NULL,'{"id":"01M8BJHP1SE9SZH9KV07MDH4DG","name":"Gr\u00f6\u00dfe","state":"reviewed","text":"KX9","created_at":"2026-11-21T09:30:02.500000Z","changed_at":"2026-11-21T09:33:10.500001Z","reading":{"source":"fused","text":"KX0","decision":"review","confidence":0.93,"characters":[{"candidates":[{"char":"K","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[0.0,0.0,0.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"X","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[1.0,0.0,1.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"0","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[2.0,0.0,2.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null}],"messages":["a word","Gr\u00f6\u00dfe"],"font":"gothic","height_mm":5.0,"rotation_deg":0.2,"verdict":"","database":"","seconds":0.4,"at":"2026-11-21T09:30:10.500001Z","part":"","error":"","height_px":null,"raised":false,"expected":"","verify_probability":null,"rivals":[],"lines":[],"codes":[],"fields":[],"program":"","settings":"","photos":0,"passes":[],"stage_s":null,"stopped":"","faults":[]},"expected":"","database":"","job":"","line":"","plan":null,"touch":null,"review":{"action":"correct","before":"KX0","after":"KX9","who":"Ada","token":"","note":"rust","at":"2026-11-21T09:33:10.500001Z"},"shadow":null}');
INSERT INTO "parts" VALUES('01M8BJHPH9T86XC5Q4DM0N0REB','touch_needed','2026-11-21 09:33:10.500001','2026-11-21 09:33:10.500001','plate 3','','','press',0,NULL,1,0,0,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL,'{"id":"01M8BJHPH9T86XC5Q4DM0N0REB","name":"plate 3","state":"touch_needed","text":"","created_at":"2026-11-21T09:33:10.500001Z","changed_at":"2026-11-21T09:33:10.500001Z","reading":{"source":"vision","text":"K8","decision":"review","confidence":0.93,"characters":[{"candidates":[{"char":"K","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[0.0,0.0,0.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"8","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[1.0,0.0,1.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null}],"messages":["a word","Gr\u00f6\u00dfe"],"font":"gothic","height_mm":5.0,"rotation_deg":0.2,"verdict":"","database":"","seconds":0.4,"at":"2026-11-21T09:33:10.500001Z","part":"","error":"","height_px":null,"raised":false,"expected":"","verify_probability":null,"rivals":[],"lines":[],"codes":[],"fields":[],"program":"","settings":"","photos":0,"passes":[],"stage_s":null,"stopped":"","faults":[]},"expected":"","database":"","job":"","line":"press","plan":{"region_mm":[-5.0,-4.0,25.0,4.0],"directions_deg":[0,90],"passes":4,"line_pitch_mm":0.2,"sample_pitch_mm":0.05,"speed_mm_s":20.0,"preload_mm":0.3,"seconds":7.5,"height_mm":5.0,"reason":"the camera is unsure","middle_mm":null},"touch":{"by_stage":false,"until":null},"review":null,"shadow":null}');
CREATE TABLE sessions (
	cookie_hash VARCHAR(64) NOT NULL, 
	token_hash VARCHAR(64) NOT NULL, 
	created_at DATETIME NOT NULL, 
	CONSTRAINT pk_sessions PRIMARY KEY (cookie_hash)
);
CREATE TABLE tactile_marks_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT tactile_marks_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "tactile_marks_version" VALUES('v1');
CREATE TABLE tokens (
	name TEXT NOT NULL, 
	secret_hash VARCHAR(64) NOT NULL, 
	scopes JSON NOT NULL, 
	created_at DATETIME NOT NULL, 
	expires_at DATETIME, 
	revoked_at DATETIME, 
	CONSTRAINT pk_tokens PRIMARY KEY (name), 
	CONSTRAINT uq_tokens_secret_hash UNIQUE (secret_hash)
);
INSERT INTO "tokens" VALUES('line-3','d06a67e5e4d5836575f0044c95f1efe1b186cd41f5be24821e5c6fe31bc6f727','["write"]','2026-11-21 09:33:10.500001',NULL,NULL);
CREATE INDEX ix_parts_agreement_created_at_would_be ON parts (agreement, created_at, would_be);
CREATE INDEX ix_parts_audit_created_at ON parts (audit, created_at);
CREATE INDEX ix_parts_state_id ON parts (state, id);
CREATE INDEX ix_parts_figures ON parts (created_at, state, fell_back, by_camera, rejected, was_right, characters, characters_right);
CREATE INDEX ix_parts_text_folded ON parts (text_folded);
CREATE INDEX ix_parts_agreement_id ON parts (agreement, id);
CREATE INDEX ix_parts_search ON parts (id, state, name_folded, text_folded, job, line, created_at);
CREATE INDEX ix_parts_audit_id ON parts (audit, id);
CREATE INDEX ix_golden_line_id ON golden (line, id);
CREATE INDEX ix_events_kind_at_actor_seconds ON events (kind, at, actor, seconds);
CREATE INDEX ix_events_part_id ON events (part_id);
CREATE TRIGGER events_no_update BEFORE update ON events BEGIN SELECT RAISE(ABORT, 'events are never changed'); END;
CREATE TRIGGER events_no_delete BEFORE delete ON events BEGIN SELECT RAISE(ABORT, 'events are never changed'); END;
CREATE TRIGGER events_no_replace BEFORE INSERT ON events WHEN EXISTS (SELECT 1 FROM events WHERE id = NEW.id) BEGIN SELECT RAISE(ABORT, 'events are never changed'); END;
CREATE INDEX ix_evidence_part_id ON evidence (part_id);
CREATE INDEX ix_evidence_gone_at ON evidence (gone, at);
CREATE INDEX ix_evidence_sha256_gone ON evidence (sha256, gone);
CREATE INDEX ix_idempotency_at ON idempotency (at);
CREATE INDEX ix_outbox_part_id_target_id ON outbox (part_id, target, id);
CREATE INDEX ix_outbox_target_due_at_id ON outbox (target, due_at, id);
DELETE FROM "sqlite_sequence";
INSERT INTO "sqlite_sequence" VALUES('outbox',3);
COMMIT;
