//! Derivatives compared with differences.

use super::{Tape, Tensor};

/// Values that repeat only after long.
pub fn wave(shape: &[usize], pace: f32) -> Tensor {
    let count: usize = shape.iter().product();
    Tensor::new(
        shape,
        (0..count)
            .map(|i| (1.0 + i as f32 * pace).sin())
            .collect::<Vec<_>>(),
    )
}

/// Compares the derivatives of a function's results, weighted differently each, with regard to every value of
/// its inputs with central differences.
pub fn assert_derivatives(inputs: &[Tensor], function: impl Fn(&[Tensor]) -> Tensor) {
    let tape = Tape::default();
    let tracked: Vec<Tensor> = inputs.iter().map(|input| input.on(&tape)).collect();
    let result = weighted(&function(&tracked));
    let mut derivatives = tape.derivatives(&[result.node().unwrap()]);
    for (number, input) in tracked.iter().enumerate() {
        let derivative = input.derivative(&mut derivatives).unwrap();
        assert_eq!(derivative.len(), input.values().len());
        for (place, derivative) in derivative.into_iter().enumerate() {
            let moved = |step: f32| {
                let mut inputs = inputs.to_vec();
                inputs[number].values_mut()[place] += step;
                weighted(&function(&inputs)).values()[0]
            };
            let difference = (moved(0.002) - moved(-0.002)) / 0.004;
            assert!(
                (derivative - difference).abs() < 5e-3 * difference.abs().max(1.0),
                "input {number}, place {place}: {derivative} {difference}"
            );
        }
    }
}

/// The sum of all values, each with a weight of its own.
fn weighted(x: &Tensor) -> Tensor {
    let weights = wave(x.shape(), 1.1).into_values();
    let sum: f64 = x
        .values()
        .iter()
        .zip(&weights)
        .map(|(x, w)| f64::from(x * w))
        .sum();
    Tensor::derived([1], vec![sum as f32], &[x.node()], move |grad, _| {
        vec![weights.into_iter().map(|w| w * grad[0]).collect()]
    })
}
