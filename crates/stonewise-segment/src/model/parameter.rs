//! Parameters of a model by name.

use crate::engine::Tensor;

/// Numbers that a model learns, unless they are fixed.
#[derive(Clone, Debug)]
pub struct Param {
    /// The numbers.
    pub tensor: Tensor,
    /// Training leaves them as they are; nothing is computed for their derivatives.
    pub is_fixed: bool,
}

/// Parameters under the names that torchvision gives them.
pub type Parameters<'a> = Vec<(String, &'a mut Param)>;

/// The name of a part.
pub fn part(of: &str, name: impl std::fmt::Display) -> String {
    format!("{of}.{name}")
}
