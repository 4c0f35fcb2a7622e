BEGIN TRANSACTION;
CREATE TABLE events (
	id INTEGER NOT NULL, 
	part_id VARCHAR(26) NOT NULL, 
	at DATETIME NOT NULL, 
	kind VARCHAR(32) NOT NULL, 
	data JSON NOT NULL, 
	CONSTRAINT pk_events PRIMARY KEY (id), 
	CONSTRAINT fk_events_part_id FOREIGN KEY(part_id) REFERENCES parts (id)
);
INSERT INTO "events" VALUES(1,'01M83SHPR41TFKPDZZEQSVYV4D','2026-11-21 09:30:00.000000','received','{"name":"plate 1","expected":"KX4","database":""}');
INSERT INTO "events" VALUES(2,'01M83SHPR41TFKPDZZEQSVYV4D','2026-11-21 09:30:00.000000','read','{"source":"vision","text":"KX4","decision":"accept","confidence":0.93}');
INSERT INTO "events" VALUES(3,'01M83SHPVBAE1PXQ02E8BP1X06','2026-11-21 09:30:02.500000','received','{"name":"Gr\u00f6\u00dfe","expected":"","database":""}');
INSERT INTO "events" VALUES(4,'01M83SHPVBAE1PXQ02E8BP1X06','2026-11-21 09:30:02.500000','read','{"source":"vision","text":"KXO","decision":"review","confidence":0.93}');
INSERT INTO "events" VALUES(5,'01M83SHPVBAE1PXQ02E8BP1X06','2026-11-21 09:30:02.500000','touch_needed','{"reason":"the camera is unsure","seconds":7.5}');
INSERT INTO "events" VALUES(6,'01M83SHPVBAE1PXQ02E8BP1X06','2026-11-21 09:30:10.500001','read','{"source":"fused","text":"KX0","decision":"review","confidence":0.93}');
INSERT INTO "events" VALUES(7,'01M83SHPVBAE1PXQ02E8BP1X06','2026-11-21 09:33:10.500001','reviewed','{"action":"correct","before":"KX0","after":"KX9","who":"Ada"}');
INSERT INTO "events" VALUES(8,'01M83SHPXF3NG4R5QF7PT55XYM','2026-11-21 09:33:10.500001','received','{"name":"plate 3","expected":"","database":""}');
INSERT INTO "events" VALUES(9,'01M83SHPXF3NG4R5QF7PT55XYM','2026-11-21 09:33:10.500001','read','{"source":"vision","text":"K8","decision":"review","confidence":0.93}');
INSERT INTO "events" VALUES(10,'01M83SHPXF3NG4R5QF7PT55XYM','2026-11-21 09:33:10.500001','touch_needed','{"reason":"the camera is unsure","seconds":7.5}');
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
INSERT INTO "evidence" VALUES(1,'01M83SHPR41TFKPDZZEQSVYV4D','2026-11-21 09:30:00.000000','photo','aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa',1000,'part 1.png','image/png','{"mm_per_pixel":0.05}',0);
INSERT INTO "evidence" VALUES(2,'01M83SHPVBAE1PXQ02E8BP1X06','2026-11-21 09:30:02.500000','photo','cccccccccccccccccccccccccccccccccccccccccccccccccccccccccccccccc',1000,'part 1.png','image/png','{"mm_per_pixel":0.05}',0);
INSERT INTO "evidence" VALUES(3,'01M83SHPVBAE1PXQ02E8BP1X06','2026-11-21 09:30:10.500001','scan','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb',2000,'part 1.h5','application/octet-stream','{}',0);
CREATE TABLE idempotency (
	key_hash VARCHAR(64) NOT NULL, 
	fingerprint TEXT NOT NULL, 
	part_id VARCHAR(26) NOT NULL, 
	at DATETIME NOT NULL, 
	CONSTRAINT pk_idempotency PRIMARY KEY (key_hash), 
	CONSTRAINT fk_idempotency_part_id FOREIGN KEY(part_id) REFERENCES parts (id)
);
INSERT INTO "idempotency" VALUES('79dbca15bce384000d0a59f0e96d6700258c71983a5af165f01650d524218427','f','01M83SHPR41TFKPDZZEQSVYV4D','2026-11-21 09:30:00.000000');
CREATE TABLE outbox (
	id INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, 
	part_id VARCHAR(26) NOT NULL, 
	target VARCHAR(32) NOT NULL, 
	payload JSON NOT NULL, 
	attempts INTEGER NOT NULL, 
	error TEXT NOT NULL, 
	created_at DATETIME NOT NULL, 
	due_at DATETIME NOT NULL, 
	CONSTRAINT fk_outbox_part_id FOREIGN KEY(part_id) REFERENCES parts (id)
);
INSERT INTO "outbox" VALUES(1,'01M83SHPR41TFKPDZZEQSVYV4D','mqtt','{"id":"01M83SHPR41TFKPDZZEQSVYV4D","name":"plate 1","state":"accepted","text":"KX4","created_at":"2026-11-21T09:30:00Z","changed_at":"2026-11-21T09:30:00Z","reading":{"source":"vision","text":"KX4","decision":"accept","confidence":0.93,"characters":[{"candidates":[{"char":"K","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[0.0,0.0,0.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"X","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[1.0,0.0,1.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"4","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[2.0,0.0,2.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null}],"messages":["a word","Gr\u00f6\u00dfe"],"font":"gothic","height_mm":5.0,"rotation_deg":0.2,"verdict":"","database":"","seconds":0.4,"at":"2026-11-21T09:30:00Z","part":"","error":"","height_px":null,"raised":false,"expected":"","verify_probability":null,"rivals":[],"lines":[],"codes":[],"program":"","settings":"","photos":0,"passes":[],"stage_s":null,"stopped":""},"expected":"KX4","database":"","plan":null,"review":null}',1,'no broker','2026-11-21 09:30:00.000000','2026-11-21 09:33:14.500001');
INSERT INTO "outbox" VALUES(2,'01M83SHPVBAE1PXQ02E8BP1X06','mqtt','{"id":"01M83SHPVBAE1PXQ02E8BP1X06","name":"Gr\u00f6\u00dfe","state":"review","text":"KX0","created_at":"2026-11-21T09:30:02.500000Z","changed_at":"2026-11-21T09:30:10.500001Z","reading":{"source":"fused","text":"KX0","decision":"review","confidence":0.93,"characters":[{"candidates":[{"char":"K","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[0.0,0.0,0.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"X","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[1.0,0.0,1.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"0","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[2.0,0.0,2.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null}],"messages":["a word","Gr\u00f6\u00dfe"],"font":"gothic","height_mm":5.0,"rotation_deg":0.2,"verdict":"","database":"","seconds":0.4,"at":"2026-11-21T09:30:10.500001Z","part":"","error":"","height_px":null,"raised":false,"expected":"","verify_probability":null,"rivals":[],"lines":[],"codes":[],"program":"","settings":"","photos":0,"passes":[],"stage_s":null,"stopped":""},"expected":"","database":"","plan":null,"review":null}',0,'','2026-11-21 09:30:10.500001','2026-11-21 09:30:10.500001');
INSERT INTO "outbox" VALUES(3,'01M83SHPVBAE1PXQ02E8BP1X06','mqtt','{"id":"01M83SHPVBAE1PXQ02E8BP1X06","name":"Gr\u00f6\u00dfe","state":"reviewed","text":"KX9","created_at":"2026-11-21T09:30:02.500000Z","changed_at":"2026-11-21T09:33:10.500001Z","reading":{"source":"fused","text":"KX0","decision":"review","confidence":0.93,"characters":[{"candidates":[{"char":"K","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[0.0,0.0,0.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"X","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[1.0,0.0,1.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"0","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[2.0,0.0,2.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null}],"messages":["a word","Gr\u00f6\u00dfe"],"font":"gothic","height_mm":5.0,"rotation_deg":0.2,"verdict":"","database":"","seconds":0.4,"at":"2026-11-21T09:30:10.500001Z","part":"","error":"","height_px":null,"raised":false,"expected":"","verify_probability":null,"rivals":[],"lines":[],"codes":[],"program":"","settings":"","photos":0,"passes":[],"stage_s":null,"stopped":""},"expected":"","database":"","plan":null,"review":{"action":"correct","before":"KX0","after":"KX9","who":"Ada","token":"","note":"rust","at":"2026-11-21T09:33:10.500001Z"}}',0,'','2026-11-21 09:33:10.500001','2026-11-21 09:33:10.500001');
CREATE TABLE parts (
	id VARCHAR(26) NOT NULL, 
	name TEXT NOT NULL, 
	state VARCHAR(16) NOT NULL, 
	text TEXT NOT NULL, 
	name_folded TEXT NOT NULL, 
	text_folded TEXT NOT NULL, 
	expected TEXT NOT NULL, 
	"database" TEXT NOT NULL, 
	"plan" JSON, 
	created_at DATETIME NOT NULL, 
	changed_at DATETIME NOT NULL, 
	reading_id INTEGER, 
	review_id INTEGER, 
	fell_back BOOLEAN NOT NULL, 
	by_camera BOOLEAN NOT NULL, 
	rejected BOOLEAN NOT NULL, 
	was_right BOOLEAN, 
	characters INTEGER, 
	characters_right INTEGER, 
	CONSTRAINT pk_parts PRIMARY KEY (id)
);
INSERT INTO "parts" VALUES('01M83SHPR41TFKPDZZEQSVYV4D','plate 1','accepted','KX4','plate 1','kx4','KX4','',NULL,'2026-11-21 09:30:00.000000','2026-11-21 09:30:00.000000',1,NULL,0,1,0,NULL,NULL,NULL);
INSERT INTO "parts" VALUES('01M83SHPVBAE1PXQ02E8BP1X06','Größe','reviewed','KX9','grösse','kx9','','',NULL,'2026-11-21 09:30:02.500000','2026-11-21 09:33:10.500001',3,1,1,0,0,0,3,2);
INSERT INTO "parts" VALUES('01M83SHPXF3NG4R5QF7PT55XYM','plate 3','touch_needed','K8','plate 3','k8','','','{"region_mm":[-5.0,-4.0,25.0,4.0],"directions_deg":[0,90],"passes":4,"line_pitch_mm":0.2,"sample_pitch_mm":0.05,"speed_mm_s":20.0,"preload_mm":0.3,"seconds":7.5,"height_mm":5.0,"reason":"the camera is unsure","middle_mm":null}','2026-11-21 09:33:10.500001','2026-11-21 09:33:10.500001',4,NULL,1,0,0,NULL,NULL,NULL);
CREATE TABLE readings (
	id INTEGER NOT NULL, 
	part_id VARCHAR(26) NOT NULL, 
	at DATETIME NOT NULL, 
	source VARCHAR(16) NOT NULL, 
	text TEXT NOT NULL, 
	decision VARCHAR(16) NOT NULL, 
	confidence DOUBLE NOT NULL, 
	seconds DOUBLE NOT NULL, 
	record JSON NOT NULL, 
	CONSTRAINT pk_readings PRIMARY KEY (id), 
	CONSTRAINT fk_readings_part_id FOREIGN KEY(part_id) REFERENCES parts (id)
);
INSERT INTO "readings" VALUES(1,'01M83SHPR41TFKPDZZEQSVYV4D','2026-11-21 09:30:00.000000','vision','KX4','accept',0.93,0.4,'{"source":"vision","text":"KX4","decision":"accept","confidence":0.93,"characters":[{"candidates":[{"char":"K","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[0.0,0.0,0.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"X","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[1.0,0.0,1.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"4","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[2.0,0.0,2.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null}],"messages":["a word","Gr\u00f6\u00dfe"],"font":"gothic","height_mm":5.0,"rotation_deg":0.2,"verdict":"","database":"","seconds":0.4,"at":null,"part":"","error":"","height_px":null,"raised":false,"expected":"","verify_probability":null,"rivals":[],"lines":[],"codes":[],"program":"","settings":"","photos":0,"passes":[],"stage_s":null,"stopped":""}');
INSERT INTO "readings" VALUES(2,'01M83SHPVBAE1PXQ02E8BP1X06','2026-11-21 09:30:02.500000','vision','KXO','review',0.93,0.4,'{"source":"vision","text":"KXO","decision":"review","confidence":0.93,"characters":[{"candidates":[{"char":"K","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[0.0,0.0,0.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"X","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[1.0,0.0,1.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"O","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[2.0,0.0,2.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null}],"messages":["a word","Gr\u00f6\u00dfe"],"font":"gothic","height_mm":5.0,"rotation_deg":0.2,"verdict":"","database":"","seconds":0.4,"at":null,"part":"","error":"","height_px":null,"raised":false,"expected":"","verify_probability":null,"rivals":[],"lines":[],"codes":[],"program":"","settings":"","photos":0,"passes":[],"stage_s":null,"stopped":""}');
INSERT INTO "readings" VALUES(3,'01M83SHPVBAE1PXQ02E8BP1X06','2026-11-21 09:30:10.500001','fused','KX0','review',0.93,0.4,'{"source":"fused","text":"KX0","decision":"review","confidence":0.93,"characters":[{"candidates":[{"char":"K","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[0.0,0.0,0.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"X","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[1.0,0.0,1.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"0","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[2.0,0.0,2.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null}],"messages":["a word","Gr\u00f6\u00dfe"],"font":"gothic","height_mm":5.0,"rotation_deg":0.2,"verdict":"","database":"","seconds":0.4,"at":null,"part":"","error":"","height_px":null,"raised":false,"expected":"","verify_probability":null,"rivals":[],"lines":[],"codes":[],"program":"","settings":"","photos":0,"passes":[],"stage_s":null,"stopped":""}');
INSERT INTO "readings" VALUES(4,'01M83SHPXF3NG4R5QF7PT55XYM','2026-11-21 09:33:10.500001','vision','K8','review',0.93,0.4,'{"source":"vision","text":"K8","decision":"review","confidence":0.93,"characters":[{"candidates":[{"char":"K","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[0.0,0.0,0.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null},{"candidates":[{"char":"8","probability":0.9,"score":0.8},{"char":"8","probability":0.1,"score":0.5}],"box_mm":[1.0,0.0,1.6,1.0],"state":"read","grade":"B","box_px":null,"state_chars":[],"action":"","depth_min_mm":null,"depth_mean_mm":null,"burr_mm":null}],"messages":["a word","Gr\u00f6\u00dfe"],"font":"gothic","height_mm":5.0,"rotation_deg":0.2,"verdict":"","database":"","seconds":0.4,"at":null,"part":"","error":"","height_px":null,"raised":false,"expected":"","verify_probability":null,"rivals":[],"lines":[],"codes":[],"program":"","settings":"","photos":0,"passes":[],"stage_s":null,"stopped":""}');
CREATE TABLE reviews (
	id INTEGER NOT NULL, 
	part_id VARCHAR(26) NOT NULL, 
	at DATETIME NOT NULL, 
	action VARCHAR(16) NOT NULL, 
	"before" TEXT NOT NULL, 
	"after" TEXT NOT NULL, 
	who TEXT NOT NULL, 
	token TEXT NOT NULL, 
	note TEXT NOT NULL, 
	CONSTRAINT pk_reviews PRIMARY KEY (id), 
	CONSTRAINT fk_reviews_part_id FOREIGN KEY(part_id) REFERENCES parts (id)
);
INSERT INTO "reviews" VALUES(1,'01M83SHPVBAE1PXQ02E8BP1X06','2026-11-21 09:33:10.500001','correct','KX0','KX9','Ada','','rust');
CREATE TABLE tactile_marks_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT tactile_marks_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "tactile_marks_version" VALUES('0001');
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
INSERT INTO "tokens" VALUES('line-3','dddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddd','["write"]','2026-11-21 09:33:10.500001',NULL,NULL);
CREATE INDEX ix_parts_state_id ON parts (state, id);
CREATE INDEX ix_parts_figures ON parts (created_at, state, fell_back, by_camera, rejected, was_right, characters, characters_right);
CREATE INDEX ix_readings_part_id ON readings (part_id);
CREATE INDEX ix_readings_at_source_seconds ON readings (at, source, seconds);
CREATE INDEX ix_evidence_part_id ON evidence (part_id);
CREATE INDEX ix_evidence_sha256_gone ON evidence (sha256, gone);
CREATE INDEX ix_evidence_gone_at ON evidence (gone, at);
CREATE INDEX ix_reviews_part_id ON reviews (part_id);
CREATE INDEX ix_events_part_id ON events (part_id);
CREATE INDEX ix_idempotency_at ON idempotency (at);
CREATE INDEX ix_outbox_due_at_id ON outbox (due_at, id);
CREATE INDEX ix_outbox_part_id_target_id ON outbox (part_id, target, id);
CREATE TRIGGER readings_no_update BEFORE UPDATE ON readings BEGIN SELECT RAISE(ABORT, 'readings are never changed'); END;
CREATE TRIGGER readings_no_delete BEFORE DELETE ON readings BEGIN SELECT RAISE(ABORT, 'readings are never changed'); END;
CREATE TRIGGER readings_no_replace BEFORE INSERT ON readings WHEN EXISTS (SELECT 1 FROM readings WHERE id = NEW.id) BEGIN SELECT RAISE(ABORT, 'readings are never changed'); END;
CREATE TRIGGER reviews_no_update BEFORE UPDATE ON reviews BEGIN SELECT RAISE(ABORT, 'reviews are never changed'); END;
CREATE TRIGGER reviews_no_delete BEFORE DELETE ON reviews BEGIN SELECT RAISE(ABORT, 'reviews are never changed'); END;
CREATE TRIGGER reviews_no_replace BEFORE INSERT ON reviews WHEN EXISTS (SELECT 1 FROM reviews WHERE id = NEW.id) BEGIN SELECT RAISE(ABORT, 'reviews are never changed'); END;
CREATE TRIGGER events_no_update BEFORE UPDATE ON events BEGIN SELECT RAISE(ABORT, 'events are never changed'); END;
CREATE TRIGGER events_no_delete BEFORE DELETE ON events BEGIN SELECT RAISE(ABORT, 'events are never changed'); END;
CREATE TRIGGER events_no_replace BEFORE INSERT ON events WHEN EXISTS (SELECT 1 FROM events WHERE id = NEW.id) BEGIN SELECT RAISE(ABORT, 'events are never changed'); END;
DELETE FROM "sqlite_sequence";
INSERT INTO "sqlite_sequence" VALUES('outbox',3);
COMMIT;
