//! Reading the tree by id. An id that is not in its tree reads as an error node, so no reader can fail.

use isograd_syntax::{
    FileId, Span,
    tree::{Block, BlockId, Expr, ExprId, ExprKind, Tree, TypeExpr, TypeId, TypeKind},
};

const NOWHERE: Span = Span::new(FileId(0), 0, 0);
static NO_EXPR: Expr = Expr { kind: ExprKind::Error, span: NOWHERE };
static NO_TYPE: TypeExpr = TypeExpr { kind: TypeKind::Error, span: NOWHERE };
static NO_BLOCK: Block = Block { stmts: Vec::new(), value: None, span: NOWHERE };

/// The expression with this id.
pub(super) fn expr(tree: &Tree, id: ExprId) -> &Expr {
    tree.exprs.get(id.0 as usize).unwrap_or(&NO_EXPR)
}

/// The type with this id.
pub(super) fn type_expr(tree: &Tree, id: TypeId) -> &TypeExpr {
    tree.types.get(id.0 as usize).unwrap_or(&NO_TYPE)
}

/// The block with this id.
pub(super) fn block(tree: &Tree, id: BlockId) -> &Block {
    tree.blocks.get(id.0 as usize).unwrap_or(&NO_BLOCK)
}
