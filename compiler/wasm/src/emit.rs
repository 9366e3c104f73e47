//! The bodies of functions: values node by node, and the loops over the points. How branches and loops of the graph run
//! in lanes is in `regions`; where columns lie, in `layout`; in which order, in `lives`; which function, in `segments`.

use std::ops::Range;

use isograd_graph::{Args, Graph, Node, NodeId, Op, PerNode, Precision, Scalar, Unready};
use wasm_encoder::{BlockType, MemArg, ValType};

use crate::code::{AT, AT_NARROW, COUNT, Code, Locals, at};
use crate::layout::Scratch;
use crate::lives::{Item, Lives, Order, storage};
use crate::rates::Rates;
use crate::regions::Frame;
use crate::segments::{Place, Segments};
use crate::tapes::Tapes;
use crate::{EmitError, Layout, Planned, Slot, lanes};

/// Bytes of a vector.
pub const VECTOR: u32 = 16;

/// The first function of a part: those before are `eval` and `point`.
pub const PARTS: u32 = 2;

/// Writes functions.
pub struct Emitter<'p> {
    pub graph: &'p Graph,
    pub rates: &'p Rates,
    pub order: &'p Order,
    pub lives: &'p Lives,
    pub layout: &'p Layout,
    pub vectors: u32,
    pub code: Code,
    pub locals: Locals,
    /// The local of each value that has one; of a varying value the first of its group.
    slots: PerNode<u32>,
    /// The open branches and loops.
    pub frames: Vec<Frame>,
    /// A group that says which lanes need what is computed; `None`: all.
    pub mask: Option<u32>,
    /// What parts leave each other.
    pub kept: Option<&'p Segments>,
    pub tapes: &'p Tapes,
    /// Where both lie.
    pub memory: Option<Scratch>,
    /// In a part, the local that says where in a column of kept values this iteration's are.
    pub scratch: u32,
}

/// Says what all functions of a module have in common.
pub struct Common<'p> {
    pub graph: &'p Graph,
    pub rates: &'p Rates,
    pub layout: &'p Layout,
    pub tapes: &'p Tapes,
    pub scratch: Option<Scratch>,
}

/// The body of an `eval` that does all by itself.
pub fn whole(common: &Common<'_>, planned: &Planned) -> Result<Vec<u8>, EmitError> {
    let mut emitter = Emitter::new(common, planned);
    emitter.begin(planned, 0);
    emitter.check_count();
    emitter.items(0..planned.order.start)?;
    emitter.count_bytes();
    emitter.points(planned.order.start..planned.order.items.len())?;
    emitter.finish(1)
}

/// The bodies of an `eval` that calls the parts, and of the parts.
pub fn split<'p>(
    common: &Common<'p>,
    segments: &'p Segments,
    scratch: Scratch,
    planned: &'p [Planned],
) -> Result<(Vec<u8>, Vec<Vec<u8>>), EmitError> {
    let Some(first) = planned.first() else { return Ok((Vec::new(), Vec::new())) };
    let mut emitter = Emitter::new(common, first);
    emitter.kept = Some(segments);
    let eval = emitter.driver(segments.once, planned.len(), scratch)?;
    let mut parts = Vec::with_capacity(planned.len());
    for (number, planned) in planned.iter().enumerate() {
        emitter.begin(planned, 1);
        if number < segments.once {
            emitter.items(0..planned.order.items.len())?;
            parts.push(emitter.finish(0)?);
            continue;
        }
        if emitter.has_narrow_columns() {
            emitter.code.sink().local_get(AT).i32_const(1).i32_shr_u().local_set(AT_NARROW);
        }
        emitter.scratch = emitter.locals.take_scalar();
        emitter.points(0..planned.order.items.len())?;
        parts.push(emitter.finish(2)?);
    }
    Ok((eval, parts))
}

/// How deep loops nest.
fn depth(graph: &Graph, order: &Order) -> u32 {
    let (mut depth, mut deepest) = (0_u32, 0);
    for item in &order.items {
        let Item::Node(id) = item else { continue };
        match graph[*id] {
            Node::Theta { .. } => {
                depth += 1;
                deepest = deepest.max(depth);
            }
            Node::End { begin } if matches!(graph[begin], Node::Theta { .. }) => depth -= 1,
            _ => {}
        }
    }
    deepest
}

impl<'p> Emitter<'p> {
    fn new(common: &Common<'p>, planned: &'p Planned) -> Self {
        Self {
            graph: common.graph,
            rates: common.rates,
            layout: common.layout,
            order: &planned.order,
            lives: &planned.lives,
            vectors: planned.vectors as u32,
            code: Code::default(),
            locals: Locals::new(1, 0),
            slots: PerNode::new(common.graph, 0),
            frames: Vec::new(),
            mask: None,
            kept: None,
            tapes: common.tapes,
            memory: common.scratch,
            scratch: 0,
        }
    }

    /// Begins a function that has so many pairs of i32 locals besides those of its loops.
    fn begin(&mut self, planned: &'p Planned, scalars: u32) {
        self.order = &planned.order;
        self.lives = &planned.lives;
        self.vectors = planned.vectors as u32;
        self.locals =
            Locals::new(self.vectors, depth(self.graph, &planned.order) + scalars + u32::from(!self.tapes.is_empty()));
    }

    /// Ends a function of so many arguments.
    fn finish(&mut self, arguments: u32) -> Result<Vec<u8>, EmitError> {
        let (scalars, vectors) = self.locals.counts(arguments);
        if scalars + vectors > 49_000 {
            return Err(EmitError::Locals { count: scalars + vectors });
        }
        Ok(std::mem::take(&mut self.code).finish(&[(scalars, ValType::I32), (vectors, ValType::V128)]))
    }

    /// Returns if the count is none.
    fn check_count(&mut self) {
        let block = self.layout.block.cast_signed();
        // count − 1 ≥ block, unsigned, also holds for a count of 0.
        self.code.sink().local_get(COUNT).i32_const(1).i32_sub().i32_const(block).i32_ge_u();
        self.code.sink().if_(BlockType::Empty).return_().end();
    }

    /// Makes the count one of bytes.
    fn count_bytes(&mut self) {
        let bytes = self.layout.precision.bytes().cast_signed();
        self.code.sink().local_get(COUNT).i32_const(bytes).i32_mul().local_set(COUNT);
    }

    /// The body of an `eval` that runs some parts once, and all others over a chunk of points before it goes on to the
    /// next.
    fn driver(&mut self, once: usize, parts: usize, scratch: Scratch) -> Result<Vec<u8>, EmitError> {
        /// The end of the chunk.
        const UNTIL: u32 = 2;
        self.check_count();
        for (function, _) in (PARTS..).zip(0..once) {
            self.code.sink().call(function);
        }
        self.count_bytes();
        let chunk = (scratch.points * self.layout.precision.bytes()).cast_signed();
        self.code.sink().loop_(BlockType::Empty);
        self.code.sink().local_get(COUNT).local_get(AT).i32_const(chunk).i32_add().local_tee(UNTIL);
        self.code.sink().local_get(COUNT).local_get(UNTIL).i32_lt_u().select().local_set(UNTIL);
        for (function, _) in (PARTS..).zip(0..parts).skip(once) {
            self.code.sink().local_get(UNTIL).local_get(AT).call(function);
        }
        self.code.sink().local_get(UNTIL).local_tee(AT).local_get(COUNT).i32_lt_u().br_if(0).end();
        self.finish(1)
    }

    fn items(&mut self, positions: Range<usize>) -> Result<(), EmitError> {
        positions.into_iter().try_for_each(|position| self.item(position))
    }

    /// The loop over the points.
    fn points(&mut self, positions: Range<usize>) -> Result<(), EmitError> {
        self.code.sink().loop_(BlockType::Empty);
        self.items(positions)?;
        let pad = self.vectors * VECTOR / self.layout.precision.bytes();
        let step = |local: u32, bytes: u32, code: &mut Code| {
            code.sink().local_get(local).i32_const(bytes.cast_signed()).i32_add().local_set(local);
        };
        if self.has_narrow_columns() {
            step(AT_NARROW, pad * 4, &mut self.code);
        }
        if self.kept.is_some() {
            step(self.scratch, self.vectors * VECTOR, &mut self.code);
        }
        let bytes = (self.vectors * VECTOR).cast_signed();
        self.code.sink().local_get(AT).i32_const(bytes).i32_add().local_tee(AT);
        self.code.sink().local_get(COUNT).i32_lt_u().br_if(0).end();
        Ok(())
    }

    /// Whether a column needs a pointer of its own.
    fn has_narrow_columns(&self) -> bool {
        let mut slots = self.layout.inputs.iter().chain(&self.layout.outputs);
        self.layout.precision == Precision::F64 && slots.any(|slot| slot.varying && slot.scalar != Scalar::Real)
    }

    fn item(&mut self, position: usize) -> Result<(), EmitError> {
        let Some(item) = self.order.items.get(position).copied() else { return Ok(()) };
        let id = match item {
            Item::Node(id) => id,
            Item::Restore(id) => {
                self.restore(id);
                return Ok(());
            }
            Item::Keep(id) => {
                self.keep(id);
                self.free(position);
                return Ok(());
            }
            Item::Output(index) => {
                if let Some((slot, output)) = self.layout.outputs.get(index).zip(self.graph.outputs.get(index)) {
                    (0..self.vectors).for_each(|vector| self.store(*slot, output.node, vector));
                }
                self.free(position);
                return Ok(());
            }
        };
        let next = match self.order.items.get(position + 1) {
            Some(Item::Node(id)) => Some(*id),
            _ => None,
        };
        match self.graph[id] {
            Node::Input(index) => self.input(id, index),
            Node::Apply(op, args) => self.apply(position, id, op, args)?,
            Node::Gamma { cond, otherwise, .. } => {
                self.gamma(cond, next == Some(otherwise));
                self.free(position);
            }
            Node::Else { gamma } => {
                if let Node::Gamma { cond, end, .. } = self.graph[gamma] {
                    self.otherwise(position, cond, end, next == Some(end));
                }
            }
            Node::Theta { lo, hi, .. } => self.theta(position, id, lo, hi),
            Node::End { begin } => {
                match self.graph[begin] {
                    Node::Gamma { cond, .. } => self.end_gamma(id, cond),
                    Node::Theta { hi, .. } => self.end_theta(begin, hi),
                    _ => {}
                }
                self.free(position);
            }
            Node::Counter { .. } => self.counter(id),
            Node::Recall { tape, at } => self.recall(position, id, tape, at),
            Node::Join { end, then, otherwise } => {
                self.late_join(id, end, then, otherwise);
                self.free(position);
            }
            _ => {}
        }
        Ok(())
    }

    /// Takes back the locals of what has been read for the last time here.
    pub fn free(&mut self, position: usize) {
        let lives = self.lives;
        for id in lives.dying(position) {
            self.locals.give(self.slots[id], !self.rates.uniform[id]);
        }
    }

    /// Gives a value its local.
    pub fn allot(&mut self, id: NodeId) -> u32 {
        let local = self.locals.take(!self.rates.uniform[id]);
        self.slots[id] = local;
        local
    }

    /// How many vectors a value has.
    pub fn width(&self, id: NodeId) -> u32 {
        if self.rates.uniform[id] { 1 } else { self.vectors }
    }

    /// The local of a value.
    pub fn local(&self, id: NodeId, vector: u32) -> u32 {
        let id = storage(self.graph, id);
        self.slots[id] + if self.rates.uniform[id] { 0 } else { vector }
    }

    /// Pushes a value.
    pub fn push(&mut self, id: NodeId, vector: u32) {
        match self.graph[id] {
            Node::Real(bits) => self.real(f64::from_bits(bits)),
            Node::Int(x) => self.code.write(|bytes| lanes::splat32(x.cast_unsigned(), bytes)),
            Node::Bool(x) => self.code.write(|bytes| lanes::splat32(if x { u32::MAX } else { 0 }, bytes)),
            _ => {
                let local = self.local(id, vector);
                self.code.get(local);
            }
        }
    }

    #[expect(clippy::cast_possible_truncation, reason = "constants of an f32 graph are f32 numbers")]
    fn real(&mut self, x: f64) {
        match self.layout.precision {
            Precision::F32 => self.code.write(|bytes| lanes::splat32((x as f32).to_bits(), bytes)),
            Precision::F64 => self.code.write(|bytes| lanes::splat64(x.to_bits(), bytes)),
        }
    }

    /// Pushes a uniform int or bool as an i32.
    pub fn push_scalar(&mut self, id: NodeId) {
        match self.graph[id] {
            Node::Int(x) => _ = self.code.sink().i32_const(x),
            Node::Bool(x) => _ = self.code.sink().i32_const(i32::from(x)),
            _ => {
                self.push(id, 0);
                self.code.sink().i32x4_extract_lane(0);
            }
        }
    }

    /// Narrows the mask on the stack to the width of a kind: in f64 modules, ints are half as wide as masks.
    pub fn narrow(&mut self, scalar: Scalar) {
        if scalar == Scalar::Int && self.layout.precision == Precision::F64 {
            self.code.write(lanes::low32);
        }
    }

    fn apply(&mut self, position: usize, id: NodeId, op: Op, args: Args) -> Result<(), EmitError> {
        let program = lanes::program(op, self.layout.precision).ok_or(EmitError::from(Unready::NoInstructions(op)))?;
        self.free(position);
        let local = self.allot(id);
        for vector in 0..self.width(id) {
            for step in &program.steps {
                match step {
                    lanes::Step::Operand(index) => {
                        let operand =
                            args.as_slice().get(*index).copied().ok_or(EmitError::from(Unready::NoInstructions(op)))?;
                        self.push(operand, vector);
                    }
                    lanes::Step::Bytes(bytes) => self.code.raw(bytes),
                }
            }
            self.code.set(local + vector);
        }
        Ok(())
    }

    /// Loads a parameter: a uniform one into all lanes.
    fn input(&mut self, id: NodeId, index: u32) {
        let Some(slot) = self.layout.inputs.get(index as usize).copied() else { return };
        let local = self.allot(id);
        let wide = self.layout.precision == Precision::F64;
        if !slot.varying {
            match (slot.scalar, wide) {
                (Scalar::Real, true) => self.code.sink().i32_const(0).v128_load64_splat(at(slot.offset, 3)),
                _ => self.code.sink().i32_const(0).v128_load32_splat(at(slot.offset, 2)),
            };
            if slot.scalar == Scalar::Bool {
                self.code.sink().v128_const(0).i32x4_ne();
            }
            self.code.set(local);
            return;
        }
        for vector in 0..self.vectors {
            if wide && slot.scalar != Scalar::Real {
                self.code.get(AT_NARROW);
                self.code.sink().v128_load64_zero(at(slot.offset + vector * VECTOR / 2, 3));
            } else {
                self.code.get(AT);
                self.code.sink().v128_load(at(slot.offset + vector * VECTOR, 4));
            }
            if slot.scalar == Scalar::Bool {
                self.code.sink().v128_const(0).i32x4_ne();
                if wide {
                    self.code.sink().i64x2_extend_low_i32x4_s();
                }
            }
            self.code.set(local + vector);
        }
    }

    /// Stores an output: NaNs with all bits set, bools as 0 or 1.
    fn store(&mut self, slot: Slot, node: NodeId, vector: u32) {
        let wide = self.layout.precision == Precision::F64;
        let narrow = wide && slot.scalar != Scalar::Real;
        self.code.get(if narrow { AT_NARROW } else { AT });
        self.push(node, vector);
        match slot.scalar {
            // x | (x ≠ x): the comparison gives all bits for a NaN and none for a number.
            Scalar::Real => {
                self.push(node, vector);
                self.push(node, vector);
                let mut sink = self.code.sink();
                _ = if wide { sink.f64x2_ne() } else { sink.f32x4_ne() };
                self.code.sink().v128_or();
            }
            Scalar::Int => {}
            Scalar::Bool => {
                if wide {
                    self.code.write(lanes::low32);
                }
                self.code.write(|bytes| lanes::splat32(1, bytes));
                self.code.sink().v128_and();
            }
        }
        if narrow {
            self.code.sink().v128_store64_lane(at(slot.offset + vector * VECTOR / 2, 3), 0);
        } else {
            self.code.sink().v128_store(at(slot.offset + vector * VECTOR, 4));
        }
    }

    /// The address of a vector that is kept for later functions: a base, to be pushed, and an offset.
    fn place(&mut self, id: NodeId, vector: u32) -> Option<MemArg> {
        let (segments, scratch) = self.kept.zip(self.memory)?;
        let offset = match segments.places.get(&id)? {
            Place::Slot(slot) => {
                self.code.sink().i32_const(0);
                scratch.slot(*slot)
            }
            Place::Column(column) => {
                self.code.get(self.scratch);
                scratch.column(*column) + vector * VECTOR
            }
        };
        Some(at(offset, 4))
    }

    /// Stores a value for later functions.
    fn keep(&mut self, id: NodeId) {
        for vector in 0..self.width(id) {
            if let Some(place) = self.place(id, vector) {
                self.push(id, vector);
                self.code.sink().v128_store(place);
            }
        }
    }

    /// Reads back what an earlier function has stored.
    fn restore(&mut self, id: NodeId) {
        let local = self.allot(id);
        for vector in 0..self.width(id) {
            if let Some(place) = self.place(id, vector) {
                self.code.sink().v128_load(place);
                self.code.set(local + vector);
            }
        }
    }

    /// A join with operands that were computed after the branch: selects where it stands.
    fn late_join(&mut self, id: NodeId, end: NodeId, then: NodeId, otherwise: NodeId) {
        let (then_late, otherwise_late) = (self.graph.is_late(end, then), self.graph.is_late(end, otherwise));
        let Some(Node::Gamma { cond, .. }) = self.graph.get(self.graph.owner(end)) else { return };
        if !then_late && !otherwise_late {
            return;
        }
        for vector in 0..self.width(id) {
            self.push(if then_late { then } else { id }, vector);
            self.push(if otherwise_late { otherwise } else { id }, vector);
            self.push(cond, vector);
            self.narrow(self.graph.scalar(id));
            self.code.sink().v128_bitselect();
            let local = self.local(id, vector);
            self.code.set(local);
        }
    }
}
