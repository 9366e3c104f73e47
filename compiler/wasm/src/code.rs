//! A function body being written, and its locals. Knows WebAssembly; knows nothing of graphs.

use wasm_encoder::{Encode, InstructionSink, MemArg};

/// The first locals. The argument of `eval`; then, and for parts, the bytes of a column of reals up to which the loop
/// over the points runs.
pub const COUNT: u32 = 0;
/// Where that loop stands: bytes from the start of a column of reals (in f32 modules: of any column) to the points of
/// this iteration.
pub const AT: u32 = 1;
/// The same for columns of 32-bit elements in f64 modules.
pub const AT_NARROW: u32 = 2;
/// The first local that loops may use for their counters.
const SCALARS: u32 = 3;

/// Writes instructions.
#[derive(Default)]
pub struct Code {
    bytes: Vec<u8>,
    /// A local to be set to what lies on top of the stack. Waiting saves an instruction if it is read next.
    pending: Option<u32>,
}

impl Code {
    fn flush(&mut self) {
        if let Some(local) = self.pending.take() {
            InstructionSink::new(&mut self.bytes).local_set(local);
        }
    }

    /// For any instruction.
    pub fn sink(&mut self) -> InstructionSink<'_> {
        self.flush();
        InstructionSink::new(&mut self.bytes)
    }

    /// Encoded instructions.
    pub fn raw(&mut self, bytes: &[u8]) {
        self.flush();
        self.bytes.extend_from_slice(bytes);
    }

    /// Encoded instructions, by a function that encodes them.
    pub fn write(&mut self, f: impl FnOnce(&mut Vec<u8>)) {
        self.flush();
        f(&mut self.bytes);
    }

    /// Pushes a local.
    pub fn get(&mut self, local: u32) {
        if self.pending == Some(local) {
            self.pending = None;
            InstructionSink::new(&mut self.bytes).local_tee(local);
        } else {
            self.sink().local_get(local);
        }
    }

    /// Pops into a local.
    pub fn set(&mut self, local: u32) {
        self.flush();
        self.pending = Some(local);
    }

    /// The body: groups of locals with their types, the instructions, the end.
    pub fn finish(mut self, locals: &[(u32, wasm_encoder::ValType)]) -> Vec<u8> {
        self.sink().end();
        let mut body = Vec::with_capacity(self.bytes.len() + 16);
        locals.len().encode(&mut body);
        for (count, kind) in locals {
            count.encode(&mut body);
            kind.encode(&mut body);
        }
        body.append(&mut self.bytes);
        body
    }
}

/// An access to memory at a constant offset; `align` is the binary logarithm of what the address is a multiple of.
pub const fn at(offset: u32, align: u32) -> MemArg {
    MemArg { offset: offset as u64, align, memory_index: 0 }
}

/// Hands out locals: vectors one by one for uniform values, in groups for varying ones. The two never share, because
/// a group is written vector by vector while a uniform operand is still read.
pub struct Locals {
    vectors: u32,
    next: u32,
    singles: Vec<u32>,
    groups: Vec<u32>,
    scalars: Vec<u32>,
    first: u32,
}

impl Locals {
    /// For groups of so many vectors and loops nested so deep.
    pub fn new(vectors: u32, depth: u32) -> Self {
        let first = SCALARS + 2 * depth;
        Self {
            vectors,
            next: first,
            singles: Vec::new(),
            groups: Vec::new(),
            scalars: (SCALARS..first).rev().collect(),
            first,
        }
    }

    /// A vector, or a group of them: the first of its locals.
    pub fn take(&mut self, group: bool) -> u32 {
        let (free, size) = if group { (&mut self.groups, self.vectors) } else { (&mut self.singles, 1) };
        free.pop().unwrap_or_else(|| {
            let local = self.next;
            self.next += size;
            local
        })
    }

    /// Takes it back.
    pub fn give(&mut self, local: u32, group: bool) {
        if group { self.groups.push(local) } else { self.singles.push(local) }
    }

    /// An i32; there are two for each loop.
    pub fn take_scalar(&mut self) -> u32 {
        self.scalars.pop().unwrap_or(SCALARS)
    }

    /// Takes an i32 back.
    pub fn give_scalar(&mut self, local: u32) {
        self.scalars.push(local);
    }

    /// How many i32 locals there are besides the arguments, and how many v128.
    pub const fn counts(&self, arguments: u32) -> (u32, u32) {
        (self.first - arguments, self.next - self.first)
    }
}
