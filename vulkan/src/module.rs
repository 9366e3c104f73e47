//! What a SPIR-V module says of itself, as far as a manifest says the same. Reads the declarations before the first
//! function; no validator.

use crate::VulkanError;

const MAGIC: u32 = 0x0723_0203;
/// SPIR-V 1.3, what Vulkan 1.1 takes at most.
const VERSION: u32 = 0x0001_0300;
const OP_ENTRY_POINT: u32 = 15;
const OP_EXECUTION_MODE: u32 = 16;
const OP_CAPABILITY: u32 = 17;
const OP_FUNCTION: u32 = 54;
const GL_COMPUTE: u32 = 5;
const LOCAL_SIZE: u32 = 17;
const SHADER: u32 = 1;
const FLOAT64: u32 = 10;
const INT64: u32 = 11;

/// The words of a module, if it has the entry point with this workgroup and asks the device for nothing but f64 and i64,
/// and for those only if it may.
pub(crate) fn words(bytes: &[u8], entry: &str, workgroup: u32, doubles: bool) -> Result<Vec<u32>, VulkanError> {
    let (quads, rest) = bytes.as_chunks::<4>();
    let words: Vec<u32> = quads.iter().map(|quad| u32::from_le_bytes(*quad)).collect();
    let malformed = |what: &str| VulkanError::Unsupported(format!("the artefact is no SPIR-V module: {what}"));
    let Some((&[magic, version, _, _, _], body)) = words.split_first_chunk::<5>() else {
        return Err(malformed("it is too short"));
    };
    if magic != MAGIC || !rest.is_empty() {
        return Err(malformed("it is not made of little-endian words, the first of them 0x07230203"));
    }
    if version > VERSION {
        return Err(malformed("its version is above 1.3"));
    }
    let (mut found, mut size) = (None, None);
    for instruction in Instructions(body) {
        let (op, operands) = instruction.ok_or_else(|| malformed("an instruction of it is cut off"))?;
        match (op, operands) {
            (OP_CAPABILITY, [SHADER]) => {}
            (OP_CAPABILITY, [FLOAT64 | INT64]) if doubles => {}
            (OP_CAPABILITY, _) => {
                return Err(VulkanError::Unsupported(format!(
                    "the module needs capability {} of the device, which a kernel of its manifest does not need",
                    operands.first().copied().unwrap_or_default()
                )));
            }
            (OP_ENTRY_POINT, [GL_COMPUTE, id, name @ ..]) if is(name, entry) => found = Some(*id),
            (OP_EXECUTION_MODE, [id, LOCAL_SIZE, sizes @ ..]) if found == Some(*id) => size = Some(sizes),
            (OP_FUNCTION, _) => break,
            _ => {}
        }
    }
    if size != Some(&[workgroup, 1, 1]) {
        return Err(VulkanError::Unsupported(format!(
            "the module has no entry point `{entry}` for workgroups of {workgroup}, which its manifest says; give the two \
             that belong together"
        )));
    }
    Ok(words)
}

/// Whether a name that begins here is this one: its bytes, a zero and as many more as fill the word.
fn is(words: &[u32], name: &str) -> bool {
    words.iter().flat_map(|word| word.to_le_bytes()).take(name.len() + 1).eq(name.bytes().chain([0]))
}

/// The instructions with their operands; `None` for one that is cut off, the last.
struct Instructions<'a>(&'a [u32]);

impl<'a> Iterator for Instructions<'a> {
    type Item = Option<(u32, &'a [u32])>;

    fn next(&mut self) -> Option<Self::Item> {
        let first = *self.0.first()?;
        match self.0.split_at_checked((first >> 16) as usize) {
            Some(([_, operands @ ..], rest)) => {
                self.0 = rest;
                Some(Some((first & 0xffff, operands)))
            }
            _ => {
                self.0 = &[];
                Some(None)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn op(op: u32, operands: &[u32]) -> Vec<u32> {
        let mut words = vec![(operands.len() as u32 + 1) << 16 | op];
        words.extend(operands);
        words
    }

    fn module(version: u32, capability: u32, size: u32) -> Vec<u8> {
        let main = u32::from_le_bytes(*b"main");
        let words = [
            vec![MAGIC, version, 0, 9, 0],
            op(OP_CAPABILITY, &[SHADER]),
            op(OP_CAPABILITY, &[capability]),
            op(OP_ENTRY_POINT, &[GL_COMPUTE, 4, main, 0, 5]),
            op(OP_EXECUTION_MODE, &[4, LOCAL_SIZE, size, 1, 1]),
            op(OP_FUNCTION, &[1, 4, 0, 2]),
            // What comes after is not looked at.
            vec![0],
        ];
        words.concat().iter().flat_map(|word| word.to_le_bytes()).collect()
    }

    #[test]
    fn a_module_is_what_its_manifest_says() {
        let good = module(VERSION, FLOAT64, 64);
        assert_eq!(words(&good, "main", 64, true).map(|words| words.len()), Ok(good.len() / 4));
        for (bytes, entry, workgroup, doubles, says) in [
            (good.clone(), "main", 64, false, "capability 10"),
            (good.clone(), "main", 32, true, "workgroups of 32"),
            (good.clone(), "mai", 64, true, "`mai`"),
            (good.clone(), "main_", 64, true, "`main_`"),
            (good[..good.len() - 1].to_vec(), "main", 64, true, "little-endian words"),
            (good[..30].to_vec(), "main", 64, true, "little-endian words"),
            (good[..36].to_vec(), "main", 64, true, "no entry point"),
            (good[..60].to_vec(), "main", 64, true, "no entry point"),
            (good[..44].to_vec(), "main", 64, true, "cut off"),
            (good[..16].to_vec(), "main", 64, true, "too short"),
            (b"\0asm\x01\0\0\0 and so on, and".to_vec(), "main", 64, true, "0x07230203"),
            (module(0x0001_0400, FLOAT64, 64), "main", 64, true, "above 1.3"),
            (module(VERSION, 5, 64), "main", 64, true, "capability 5"),
        ] {
            let Err(VulkanError::Unsupported(text)) = words(&bytes, entry, workgroup, doubles) else {
                panic!("{says}: it is taken")
            };
            assert!(text.contains(says), "{says}: {text}");
        }
    }
}
