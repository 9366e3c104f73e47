//! Which exports of a program with errors can be elaborated all the same: those from which nothing unsound can be
//! reached. Knows who calls, builds and evaluates what; knows nothing of values.

use std::collections::BTreeSet;

use crate::Program;
use crate::typed::{Code, ConceptId, DefinitionId, FunctionId, ImplId, Instruction};

/// What can be reached from a function.
#[derive(Default)]
struct Reach<'p> {
    functions: BTreeSet<FunctionId>,
    impls: BTreeSet<ImplId>,
    built: BTreeSet<DefinitionId>,
    evaluated: BTreeSet<ConceptId>,
    /// Bodies to be looked at.
    open: Vec<&'p Code>,
}

impl Program {
    /// Whether everything that elaborating this function can come across is free of errors. Any node built is taken
    /// to be evaluated under any concept evaluated.
    #[must_use]
    pub fn is_sound_from(&self, function: FunctionId) -> bool {
        let mut reach = Reach::default();
        if !reach.call(self, function) {
            return false;
        }
        while let Some(code) = reach.open.pop() {
            for (instruction, _) in &code.instructions {
                let sound = match instruction {
                    Instruction::Call(id) => reach.call(self, *id),
                    Instruction::Node { definition, .. } => reach.build(self, *definition),
                    Instruction::Eval { concept, live: true } => reach.evaluate(self, *concept),
                    _ => true,
                };
                if !sound {
                    return false;
                }
            }
        }
        true
    }
}

impl<'p> Reach<'p> {
    fn call(&mut self, program: &'p Program, id: FunctionId) -> bool {
        if self.functions.insert(id) {
            self.open.extend(program.functions.get(id.0 as usize).map(|f| &f.code));
        }
        !program.unsound.functions.contains(&id)
    }

    fn build(&mut self, program: &'p Program, id: DefinitionId) -> bool {
        if !self.built.insert(id) {
            return true;
        }
        let concepts: Vec<ConceptId> = self.evaluated.iter().copied().collect();
        !program.unsound.definitions.contains(&id) && concepts.into_iter().all(|c| self.meet(program, id, c))
    }

    fn evaluate(&mut self, program: &'p Program, id: ConceptId) -> bool {
        if !self.evaluated.insert(id) {
            return true;
        }
        let built: Vec<DefinitionId> = self.built.iter().copied().collect();
        !program.unsound.concepts.contains(&id) && built.into_iter().all(|d| self.meet(program, d, id))
    }

    /// A node of this definition may be evaluated under this concept.
    fn meet(&mut self, program: &'p Program, definition: DefinitionId, concept: ConceptId) -> bool {
        if let Some(id) = program.impl_of.get(&(definition, concept)).copied() {
            if self.impls.insert(id) {
                self.open.extend(program.impls.get(id.0 as usize).map(|i| &i.code));
            }
            return !program.unsound.impls.contains(&id);
        }
        let may_be = |(d, c): &(Option<DefinitionId>, Option<ConceptId>)| {
            d.is_none_or(|d| d == definition) && c.is_none_or(|c| c == concept)
        };
        !program.unsound.lost_impls.iter().any(may_be)
    }
}
