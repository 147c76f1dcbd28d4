//! Telemetry logs from a stranger: every payload whole, every byte in a frame or counted as lost.
#![no_main]

use std::collections::HashMap;

use flightid_logs::mavlink;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let known = HashMap::from([(0, (9, 50)), (30, (28, 39))]);
    let Ok(heard) = mavlink::read(data, &known, 1 << 24) else {
        return;
    };
    for ((message, ..), frames) in &heard.frames {
        assert_eq!(frames.payloads.len(), frames.stamps_us.len() * known[message].0);
    }
    assert!(heard.lost <= data.len());
    let _ = mavlink::is_telemetry(data);
});
