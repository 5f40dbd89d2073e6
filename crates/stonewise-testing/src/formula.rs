//! Weights and an image that follow from a formula: that of testdata/mask_rcnn/formula.py.

/// Values of the detections' own weights.
const GAINS: [(&str, f64); 5] = [
    ("rpn.head.cls_logits.weight", 0.7),
    ("rpn.head.bbox_pred.weight", 0.3),
    ("roi_heads.box_predictor.cls_score.weight", 0.9),
    ("roi_heads.box_predictor.bbox_pred.weight", 0.7),
    ("roi_heads.mask_predictor.mask_fcn_logits.weight", 2.0),
];

fn fnv1a(text: &str) -> u32 {
    text.bytes().fold(2_166_136_261, |h, byte| {
        (h ^ u32::from(byte)).wrapping_mul(16_777_619)
    })
}

/// A number in [-1, 1) from a name's hash and a place.
fn number(key: u32, place: u32) -> f64 {
    let mut h = place.wrapping_mul(2_654_435_761).wrapping_add(key);
    for _ in 0..2 {
        h = (h ^ (h >> 16)).wrapping_mul(0x045D_9F3B);
    }
    f64::from((h ^ (h >> 16)) >> 8) / f64::from(1 << 23) - 1.0
}

/// Numbers in [-1, 1) from a name.
pub fn unit(key: &str, count: u32) -> Vec<f32> {
    let hash = fnv1a(key);
    (0..count).map(|place| number(hash, place) as f32).collect()
}

/// The values of a parameter of this name and shape.
pub fn parameter(key: &str, shape: &[usize]) -> Vec<f32> {
    let (offset, spread) = if key.ends_with("running_var") {
        (1.0, 0.5)
    } else if key.ends_with("running_mean") {
        (0.0, 0.1)
    } else if shape.len() == 1 && key.ends_with("weight") {
        (0.6, 0.2)
    } else if shape.len() == 1 {
        (0.0, 0.05)
    } else {
        let inputs: usize = if key.contains("conv5_mask") {
            4 * shape[0]
        } else {
            shape[1..].iter().product()
        };
        let gain = GAINS
            .iter()
            .find(|(name, _)| *name == key)
            .map_or(1.0, |(_, gain)| *gain);
        (0.0, gain * (6.0 / inputs as f64).sqrt())
    };
    let hash = fnv1a(key);
    let count: usize = shape.iter().product();
    (0..count)
        .map(|place| (offset + spread * number(hash, place as u32)) as f32)
        .collect()
}

/// Blocks of colour with a texture, row by row.
pub fn image(width: u32, height: u32) -> Vec<[u8; 3]> {
    let pixel = |place: u32| {
        let (x, y) = (place % width, place / width);
        let shifted = y + 5 * (x / 23);
        let block = x / 23 * 7 + shifted / 17 * 13;
        [0, 1, 2].map(|c| {
            let value = if x % 23 < 2 || shifted % 17 < 2 {
                30 + (x + y) % 11
            } else {
                (block * 37 + c * 61) % 160 + (x * 7 + y * 3 + c * 5) % 29 + 20
            };
            value as u8
        })
    };
    (0..width * height).map(pixel).collect()
}
