//! Where the brackets of a body's code close, so that the machine can jump. Knows nothing of values.

use std::rc::Rc;

use isograd_program::typed::{Code, Instruction};

/// For each instruction of a [`Code`]: an `If` leads to its `Else`, that to its `EndIf`, a `For` to its `EndFor` and
/// that back; others lead nowhere.
pub(crate) type Jumps = Rc<[Option<usize>]>;

/// The jumps of a body; `None` if its brackets do not fit.
pub(crate) fn jumps(code: &Code) -> Option<Jumps> {
    let mut jumps = vec![None; code.instructions.len()];
    let mut link = |from: usize, to: usize| {
        if let Some(place) = jumps.get_mut(from) {
            *place = Some(to);
        }
    };
    let mut open: Vec<(usize, &Instruction)> = Vec::new();
    for (at, (instruction, _)) in code.instructions.iter().enumerate() {
        match instruction {
            Instruction::If(_) | Instruction::For(_) | Instruction::Block { .. } => open.push((at, instruction)),
            Instruction::Else => {
                let (start, Instruction::If(_)) = open.pop()? else { return None };
                link(start, at);
                open.push((at, instruction));
            }
            Instruction::EndIf => {
                let (start, Instruction::Else) = open.pop()? else { return None };
                link(start, at);
            }
            Instruction::EndFor => {
                let (start, Instruction::For(_)) = open.pop()? else { return None };
                link(start, at);
                link(at, start);
            }
            Instruction::EndBlock => {
                let (_, Instruction::Block { .. }) = open.pop()? else { return None };
            }
            Instruction::Int(_)
            | Instruction::Real(_)
            | Instruction::Bool(_)
            | Instruction::Load(_)
            | Instruction::Store(_)
            | Instruction::Drop
            | Instruction::Pack(_)
            | Instruction::Splat(_)
            | Instruction::Pick { .. }
            | Instruction::Cast { .. }
            | Instruction::Neg(_)
            | Instruction::Not
            | Instruction::Binary { .. }
            | Instruction::Builtin { .. }
            | Instruction::Interval(_)
            | Instruction::PackIntervals(_)
            | Instruction::SplatInterval(_)
            | Instruction::End { .. }
            | Instruction::PickInterval { .. }
            | Instruction::MayBeNan
            | Instruction::Diff
            | Instruction::Bound { .. }
            | Instruction::Call(_)
            | Instruction::Node { .. }
            | Instruction::Eval { .. } => {}
        }
    }
    open.is_empty().then(|| jumps.into())
}
