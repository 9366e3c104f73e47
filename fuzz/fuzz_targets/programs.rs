//! Programs that are well typed by construction have no errors.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Err(failure) = isograd_testkit::laws::structured(isograd_testkit::programs::Choices::Bytes(bytes)) {
        panic!("{failure}");
    }
});
