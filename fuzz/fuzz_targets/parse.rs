//! Any bytes are read.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Err(failure) = isograd_testkit::laws::parsed(bytes) {
        panic!("{failure}");
    }
});
