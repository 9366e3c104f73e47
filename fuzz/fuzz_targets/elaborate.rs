//! Any bytes that are a program are specialised.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Err(failure) = isograd_testkit::laws::elaborated(bytes) {
        panic!("{failure}");
    }
});
