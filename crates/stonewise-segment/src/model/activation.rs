//! From logits to probabilities.

/// The probability of a logit.
pub fn sigmoid(logit: f32) -> f32 {
    if logit >= 0.0 {
        1.0 / (1.0 + (-logit).exp())
    } else {
        let odds = logit.exp();
        odds / (1.0 + odds)
    }
}

/// The probabilities of classes, of which one is the case.
pub fn softmax(logits: &[f32]) -> Vec<f32> {
    let most = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let mut shares: Vec<f32> = logits.iter().map(|logit| (logit - most).exp()).collect();
    let part = 1.0 / shares.iter().sum::<f32>();
    shares.iter_mut().for_each(|share| *share *= part);
    shares
}
