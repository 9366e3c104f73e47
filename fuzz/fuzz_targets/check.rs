//! Any bytes are checked.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Err(failure) = isograd_testkit::laws::checked(bytes) {
        panic!("{failure}");
    }
});
