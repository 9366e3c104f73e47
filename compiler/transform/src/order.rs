//! Depth-first order: what a value needs stands right before it, the operand that needs more registers first
//! (Sethi & Ullman, *The Generation of Optimal Code for Arithmetic Expressions*, 1970, on a dag as if it were a
//! tree). A branch or loop is one item of the region around it and is ordered inside in the same way.

use isograd_graph::{Graph, Node, NodeId};

/// All nodes that the outputs need, marks included, in depth-first order.
#[must_use]
pub fn depth_first(graph: &Graph) -> Vec<NodeId> {
    let layout = Layout::of(graph);
    let mut order: Vec<NodeId> = graph.iter().filter(|(_, n)| matches!(n, Node::Input(_))).map(|(id, _)| id).collect();
    let mut walk = Walk { graph, placed: vec![false; graph.len()], layout: &layout };
    for id in &order {
        walk.place(*id);
    }
    // What is left to do, the next thing last.
    let roots: Vec<NodeId> = graph.outputs.iter().map(|o| o.node).collect();
    let mut todo = vec![Task::Region { roots, at: 0 }];
    while let Some(task) = todo.pop() {
        walk.run(task, &mut todo, &mut order);
    }
    order
}

/// A step of the walk.
enum Task {
    /// Order what these results of a region need, from the one at `at` on.
    Region { roots: Vec<NodeId>, at: usize },
    /// Put an item after what it needs.
    Visit(NodeId),
    /// Put an item, whose needs are met.
    Put(NodeId),
    /// Put a mark.
    Mark(NodeId),
}

/// Which region each node lies in, and what each item of a region needs of the same region.
struct Layout {
    /// The item that a node is, or belongs to as a join, final or tape: the begin of its structure.
    item: Vec<NodeId>,
    /// By item: items of the same region that it needs, in the order of use.
    needs: Vec<Vec<NodeId>>,
    /// Registers that computing an item takes.
    weight: Vec<u32>,
    /// By begin: joins, or finals and then tapes.
    results: Vec<Vec<NodeId>>,
    /// By theta: its carried variables.
    carried: Vec<Vec<NodeId>>,
}

impl Layout {
    fn of(graph: &Graph) -> Self {
        let n = graph.len();
        let mut this = Self {
            item: graph.iter().map(|(id, _)| id).collect(),
            needs: vec![Vec::new(); n],
            weight: vec![1; n],
            results: vec![Vec::new(); n],
            carried: vec![Vec::new(); n],
        };
        // How deep each node lies, and the structures open here from the outermost.
        let mut depth = vec![0_usize; n];
        let mut open: Vec<NodeId> = Vec::new();
        for (id, node) in graph.iter() {
            match node {
                Node::End { begin } => {
                    open.pop();
                    set(&mut this.item, id, begin);
                    this.weigh(begin);
                }
                Node::Else { gamma } => set(&mut this.item, id, gamma),
                Node::Join { end, .. } | Node::Final { end, .. } | Node::Tape { end, .. } => {
                    let begin = this.item.get(end.index()).copied().unwrap_or(end);
                    set(&mut this.item, id, begin);
                    if let Some(list) = this.results.get_mut(begin.index()) {
                        list.push(id);
                    }
                }
                Node::Carried { theta, .. } => {
                    if let Some(list) = this.carried.get_mut(theta.index()) {
                        list.push(id);
                    }
                }
                _ => {}
            }
            set(&mut depth, id, open.len());
            if !matches!(node, Node::Join { .. } | Node::Final { .. } | Node::Tape { .. }) {
                node.each_operand(|x| this.need(&depth, &open, id, x));
            } else {
                // A result may name a value from around its structure.
                let begin = this.item.get(id.index()).copied().unwrap_or(id);
                node.each_operand(|x| {
                    if x < begin && depth.get(x.index()).is_some_and(|d| *d <= open.len()) {
                        this.need(&depth, &open, begin, x);
                    }
                });
            }
            if matches!(node, Node::Gamma { .. } | Node::Theta { .. }) {
                open.push(id);
            } else {
                this.weigh(id);
            }
        }
        this
    }

    /// Notes that `user`, inside the structures `open`, needs `x`: in the region of `x`, the item is the structure
    /// that contains the user, if one does.
    fn need(&mut self, depth: &[usize], open: &[NodeId], user: NodeId, x: NodeId) {
        let at = depth.get(x.index()).copied().unwrap_or(0);
        let item = open.get(at).copied().unwrap_or(user);
        let needed = self.item.get(x.index()).copied().unwrap_or(x);
        if let Some(list) = self.needs.get_mut(item.index())
            && needed != item
        {
            list.push(needed);
        }
    }

    /// Sorts the needs of an item, the heaviest first, and weighs it.
    fn weigh(&mut self, item: NodeId) {
        let mut needs = self.needs.get_mut(item.index()).map(std::mem::take).unwrap_or_default();
        needs.sort_by_key(|x| std::cmp::Reverse(self.weight_of(*x)));
        needs.dedup();
        let held = (0_u32..).zip(&needs).map(|(i, x)| self.weight_of(*x).saturating_add(i)).max();
        set(&mut self.weight, item, held.unwrap_or(1).max(1));
        if let Some(place) = self.needs.get_mut(item.index()) {
            *place = needs;
        }
    }

    fn weight_of(&self, item: NodeId) -> u32 {
        self.weight.get(item.index()).copied().unwrap_or(1)
    }
}

fn set<T>(list: &mut [T], id: NodeId, value: T) {
    if let Some(place) = list.get_mut(id.index()) {
        *place = value;
    }
}

struct Walk<'g> {
    graph: &'g Graph,
    placed: Vec<bool>,
    layout: &'g Layout,
}

impl Walk<'_> {
    /// Marks an item as placed; whether it was not yet.
    fn place(&mut self, item: NodeId) -> bool {
        self.placed.get_mut(item.index()).is_some_and(|p| !std::mem::replace(p, true))
    }

    fn item(&self, id: NodeId) -> NodeId {
        self.layout.item.get(id.index()).copied().unwrap_or(id)
    }

    fn run(&mut self, task: Task, todo: &mut Vec<Task>, order: &mut Vec<NodeId>) {
        match task {
            Task::Region { roots, at } => {
                if let Some(root) = roots.get(at).copied() {
                    todo.push(Task::Region { roots, at: at + 1 });
                    todo.push(Task::Visit(self.item(root)));
                }
            }
            Task::Visit(item) => {
                if self.placed.get(item.index()).copied().unwrap_or(true) {
                    return;
                }
                todo.push(Task::Put(item));
                let needs = self.layout.needs.get(item.index()).map_or(&[][..], Vec::as_slice);
                todo.extend(needs.iter().rev().map(|x| Task::Visit(*x)));
            }
            Task::Put(item) => {
                if self.place(item) {
                    self.put(item, todo, order);
                }
            }
            Task::Mark(mark) => order.push(mark),
        }
    }

    /// Puts an item; a structure with all that is inside.
    fn put(&mut self, item: NodeId, todo: &mut Vec<Task>, order: &mut Vec<NodeId>) {
        order.push(item);
        let results = self.layout.results.get(item.index()).cloned().unwrap_or_default();
        let pick = |side: fn(Node) -> Option<NodeId>| -> Vec<NodeId> {
            let values = results.iter().filter_map(|r| side(self.graph.get(*r)?));
            // What lies outside of the structure was needed by it and is placed already.
            values.filter(|x| *x > item).collect()
        };
        match self.graph.get(item) {
            Some(Node::Gamma { otherwise, end, .. }) => {
                let then = pick(|n| if let Node::Join { then, .. } = n { Some(then) } else { None });
                let other = pick(|n| if let Node::Join { otherwise, .. } = n { Some(otherwise) } else { None });
                todo.extend(results.iter().rev().map(|r| Task::Mark(*r)));
                todo.push(Task::Mark(end));
                todo.push(Task::Region { roots: other, at: 0 });
                todo.push(Task::Mark(otherwise));
                todo.push(Task::Region { roots: then, at: 0 });
            }
            Some(Node::Theta { end, .. }) => {
                let next = pick(|n| match n {
                    Node::Final { next: x, .. } | Node::Tape { value: x, .. } => Some(x),
                    _ => None,
                });
                todo.extend(results.iter().rev().map(|r| Task::Mark(*r)));
                todo.push(Task::Mark(end));
                todo.push(Task::Region { roots: next, at: 0 });
                for carried in self.layout.carried.get(item.index()).cloned().unwrap_or_default() {
                    if self.place(carried) {
                        order.push(carried);
                    }
                }
            }
            _ => {}
        }
    }
}
