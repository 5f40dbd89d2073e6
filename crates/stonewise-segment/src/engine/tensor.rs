//! Tensors, on a tape or not.

use super::tape::{Derivatives, Node, Tape};
use std::sync::Arc;

/// 32-bit floats, the last index changing fastest, and perhaps a place on a tape.
#[derive(Clone, Debug)]
pub struct Tensor {
    shape: Vec<usize>,
    values: Arc<Vec<f32>>,
    node: Option<Node>,
}

impl Tensor {
    /// A tensor of these sides that is on no tape.
    pub fn new(shape: impl Into<Vec<usize>>, values: impl Into<Arc<Vec<f32>>>) -> Self {
        Self::derived(shape, values, &[], |_, _| Vec::new())
    }

    /// The result of an operation on `inputs`, recorded as [`Node::of`] says.
    pub fn derived(
        shape: impl Into<Vec<usize>>,
        values: impl Into<Arc<Vec<f32>>>,
        inputs: &[Option<Node>],
        backward: impl FnOnce(Vec<f32>, &[bool]) -> Vec<Vec<f32>> + Send + 'static,
    ) -> Self {
        let (shape, values) = (shape.into(), values.into());
        debug_assert_eq!(shape.iter().product::<usize>(), values.len());
        Self {
            shape,
            values,
            node: Node::of(inputs, backward),
        }
    }

    /// The tensor as a leaf of a tape.
    pub fn on(&self, tape: &Tape) -> Self {
        Self {
            node: Some(tape.leaf()),
            ..self.clone()
        }
    }

    /// The derivative with respect to this leaf; `None` where it is not a leaf or nothing depends on it.
    pub fn derivative(&self, derivatives: &mut Derivatives) -> Option<Vec<f32>> {
        derivatives.take(self.node.as_ref()?)
    }

    /// Number of values along each side.
    pub fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// The first sides; 1 beyond the last.
    pub fn dims<const COUNT: usize>(&self) -> [usize; COUNT] {
        std::array::from_fn(|side| self.shape.get(side).copied().unwrap_or(1))
    }

    /// All values.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// All values, to be changed; they are copied first where another tensor shares them.
    pub fn values_mut(&mut self) -> &mut [f32] {
        Arc::make_mut(&mut self.values).as_mut_slice()
    }

    /// All values, not copied unless another tensor shares them.
    pub fn into_values(self) -> Vec<f32> {
        Arc::try_unwrap(self.values).unwrap_or_else(|shared| shared.to_vec())
    }

    /// All values, shared.
    pub fn shared(&self) -> Arc<Vec<f32>> {
        self.values.clone()
    }

    /// Its place on a tape.
    pub fn node(&self) -> Option<Node> {
        self.node.clone()
    }

    /// Changes the shape and keeps the values; the number of elements stays as it is.
    #[must_use]
    pub fn reshaped(self, shape: impl Into<Vec<usize>>) -> Self {
        let shape = shape.into();
        debug_assert_eq!(shape.iter().product::<usize>(), self.values.len());
        Self { shape, ..self }
    }
}

impl PartialEq for Tensor {
    fn eq(&self, other: &Self) -> bool {
        self.shape == other.shape && self.values == other.values
    }
}
