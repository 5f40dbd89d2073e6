//! Arithmetic of boxes: left, top, right, bottom, in pixels.

/// Left, top, right, bottom.
pub type Bounds = [f32; 4];

/// Weights of the box head's offsets (Girshick 2015; their inverse standard deviations).
pub const HEAD_WEIGHTS: [f32; 4] = [10.0, 10.0, 5.0, 5.0];
/// Weights of the proposal network's offsets.
pub const PROPOSAL_WEIGHTS: [f32; 4] = [1.0, 1.0, 1.0, 1.0];
/// Largest logarithm of a growth in size that is accepted: a factor 1000 / 16.
const MAX_LOG_SCALE: f32 = 4.135_166_6;

/// Area of a box, square pixels.
pub fn area([left, top, right, bottom]: Bounds) -> f32 {
    (right - left) * (bottom - top)
}

/// Intersection over union of two boxes.
pub fn iou(a: Bounds, b: Bounds) -> f32 {
    let width = (a[2].min(b[2]) - a[0].max(b[0])).max(0.0);
    let height = (a[3].min(b[3]) - a[1].max(b[1])).max(0.0);
    let both = width * height;
    if both == 0.0 {
        0.0
    } else {
        both / (area(a) + area(b) - both)
    }
}

/// The part of a box inside an image, pixels.
pub fn clip([left, top, right, bottom]: Bounds, width: f32, height: f32) -> Bounds {
    [
        left.clamp(0.0, width),
        top.clamp(0.0, height),
        right.clamp(0.0, width),
        bottom.clamp(0.0, height),
    ]
}

/// True where both sides are at least `min` pixels long.
pub fn is_large([left, top, right, bottom]: Bounds, min: f32) -> bool {
    right - left >= min && bottom - top >= min
}

/// Offsets that turn `reference` into `target` (Girshick et al. 2014, eqs. 6-9): shift of the centre in sizes
/// of the reference, log of the growth; each times its weight.
pub fn encode(reference: Bounds, target: Bounds, weights: [f32; 4]) -> [f32; 4] {
    let ([x, y], [width, height]) = center_size(reference);
    let ([target_x, target_y], [target_width, target_height]) = center_size(target);
    [
        weights[0] * (target_x - x) / width,
        weights[1] * (target_y - y) / height,
        weights[2] * (target_width / width).ln(),
        weights[3] * (target_height / height).ln(),
    ]
}

/// The box that offsets from [`encode`] lead to.
pub fn decode(reference: Bounds, offsets: [f32; 4], weights: [f32; 4]) -> Bounds {
    let ([x, y], [width, height]) = center_size(reference);
    let center_x = offsets[0] / weights[0] * width + x;
    let center_y = offsets[1] / weights[1] * height + y;
    let half_width = 0.5 * width * (offsets[2] / weights[2]).min(MAX_LOG_SCALE).exp();
    let half_height = 0.5 * height * (offsets[3] / weights[3]).min(MAX_LOG_SCALE).exp();
    [
        center_x - half_width,
        center_y - half_height,
        center_x + half_width,
        center_y + half_height,
    ]
}

fn center_size([left, top, right, bottom]: Bounds) -> ([f32; 2], [f32; 2]) {
    let size = [right - left, bottom - top];
    ([left + 0.5 * size[0], top + 0.5 * size[1]], size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decoding_undoes_encoding() {
        let reference = [10.0, 20.0, 42.0, 36.0];
        let target = [3.5, 18.0, 77.0, 64.25];
        for weights in [PROPOSAL_WEIGHTS, HEAD_WEIGHTS] {
            let decoded = decode(reference, encode(reference, target, weights), weights);
            for (a, b) in decoded.iter().zip(target) {
                assert!((a - b).abs() < 1e-4, "{decoded:?}");
            }
        }
    }

    #[test]
    fn overlap_by_counting_pixels() {
        let (a, b) = ([2.0, 3.0, 10.0, 9.0], [5.0, 1.0, 14.0, 7.0]);
        let inside = |p: [usize; 2], [l, t, r, b]: Bounds| {
            let [x, y] = p.map(|v| v as f32 + 0.5);
            x > l && x < r && y > t && y < b
        };
        let cells = || (0..400).map(|i| [i % 20, i / 20]);
        let both = cells().filter(|&p| inside(p, a) && inside(p, b)).count();
        let any = cells().filter(|&p| inside(p, a) || inside(p, b)).count();
        assert!((iou(a, b) - both as f32 / any as f32).abs() < 1e-6);
        assert_eq!(iou(a, [20.0, 20.0, 30.0, 30.0]), 0.0);
    }
}
