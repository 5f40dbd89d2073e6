//! What was computed, in its order, so that it can be differentiated (reverse mode: Griewank & Walther 2008,
//! chapter 3).

use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// From the derivative with regard to the result of an operation to those with regard to its inputs.
type Backward = Box<dyn FnOnce(Vec<f32>) -> Vec<Vec<f32>> + Send>;

/// A record of operations.
#[derive(Clone, Default)]
pub struct Tape(Arc<Mutex<Vec<Step>>>);

/// An entry of a tape: a result that others may be computed from.
#[derive(Clone, Debug)]
pub struct Node {
    tape: Tape,
    place: usize,
}

/// Derivatives of a sum of results with regard to the leaves of a tape.
pub struct Derivatives(Vec<Option<Vec<f32>>>);

struct Step {
    /// Places of the inputs; `None` for those that are not on the tape.
    inputs: Vec<Option<usize>>,
    /// `None` for a leaf, which was not computed from anything.
    backward: Option<Backward>,
}

impl Tape {
    /// Adds a leaf: something whose derivative is wanted.
    pub fn leaf(&self) -> Node {
        self.push(Step {
            inputs: Vec::new(),
            backward: None,
        })
    }

    /// Derivatives of the sum of `results`, each a single number; the record ends with it.
    pub fn derivatives(&self, results: &[Node]) -> Derivatives {
        let steps = std::mem::take(&mut *self.steps());
        let mut derivatives: Vec<Option<Vec<f32>>> = vec![None; steps.len()];
        for result in results {
            add(&mut derivatives[result.place], vec![1.0]);
        }
        for (place, step) in steps.into_iter().enumerate().rev() {
            let Some(backward) = step.backward else { continue };
            let Some(derivative) = derivatives[place].take() else {
                continue;
            };
            for (input, derivative) in step.inputs.into_iter().zip(backward(derivative)) {
                if let Some(input) = input {
                    add(&mut derivatives[input], derivative);
                }
            }
        }
        Derivatives(derivatives)
    }

    fn push(&self, step: Step) -> Node {
        let mut steps = self.steps();
        steps.push(step);
        Node {
            tape: self.clone(),
            place: steps.len() - 1,
        }
    }

    fn steps(&self) -> MutexGuard<'_, Vec<Step>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for Tape {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_struct("Tape").finish_non_exhaustive()
    }
}

impl Node {
    /// Records an operation if one of its inputs is on a tape.
    ///
    /// `backward` gets the derivative with regard to the result, and which inputs are on the tape; it returns
    /// the derivatives with regard to the inputs, anything for those that are not.
    pub fn of(
        inputs: &[Option<Self>],
        backward: impl FnOnce(Vec<f32>, &[bool]) -> Vec<Vec<f32>> + Send + 'static,
    ) -> Option<Self> {
        let tape = inputs.iter().flatten().next()?.tape.clone();
        let wanted: Vec<bool> = inputs.iter().map(Option::is_some).collect();
        Some(
            tape.push(Step {
                inputs: inputs
                    .iter()
                    .map(|node| node.as_ref().map(|node| node.place))
                    .collect(),
                backward: Some(Box::new(move |derivative| backward(derivative, &wanted))),
            }),
        )
    }
}

impl Derivatives {
    /// Takes the derivative with regard to a leaf out; `None` where the results do not depend on it.
    pub fn take(&mut self, leaf: &Node) -> Option<Vec<f32>> {
        self.0[leaf.place].take()
    }
}

fn add(sum: &mut Option<Vec<f32>>, more: Vec<f32>) {
    match sum {
        Some(sum) => sum.iter_mut().zip(more).for_each(|(sum, more)| *sum += more),
        None => *sum = Some(more),
    }
}
