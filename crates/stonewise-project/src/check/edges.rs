//! Edges of a depth map and of a photo that can be compared although one holds metres and the other grey
//! values.

/// A map of numbers, some of which may be missing.
#[derive(Clone)]
pub(super) struct Map {
    pub width: usize,
    pub height: usize,
    /// Row by row; NaN where nothing is known.
    pub values: Vec<f32>,
}

/// Half width of the smoothing, pixels.
const SMOOTH: usize = 2;
/// Half width of the window whose mean slope is taken away: a face seen at an angle has no edge.
const SLOPE_WINDOW: usize = 10;
/// Half width of the window in which edges are made equally strong.
const CONTRAST_WINDOW: usize = 15;

/// An edge in every pixel as a vector of twice its direction's angle: bright-to-dark and dark-to-bright are
/// the same.
pub(super) struct Edges {
    pub width: usize,
    pub height: usize,
    pub vectors: Vec<[f32; 2]>,
}

impl Edges {
    /// Edges of a map: gradients against the slope around them, all of about the same strength; zero where
    /// values are missing.
    pub fn of(map: &Map) -> Self {
        let (w, h) = (map.width, map.height);
        let known: Vec<f32> = map
            .values
            .iter()
            .map(|v| f32::from(u8::from(v.is_finite())))
            .collect();
        let filled: Vec<f32> = map
            .values
            .iter()
            .map(|v| if v.is_finite() { *v } else { 0.0 })
            .collect();
        let near = box_mean(&known, w, h, SMOOTH + 2);
        let (sum, weight) = (smooth(&filled, w, h), smooth(&known, w, h));
        let smoothed: Vec<f32> = sum
            .iter()
            .zip(&weight)
            .map(|(s, n)| if *n > 0.0 { s / n } else { 0.0 })
            .collect();

        let inner: Vec<f32> = near.iter().map(|n| f32::from(u8::from(*n > 0.999))).collect();
        let (mut gx, mut gy) = (vec![0.0; w * h], vec![0.0; w * h]);
        for y in 1..h.saturating_sub(1) {
            for x in 1..w.saturating_sub(1) {
                let i = y * w + x;
                gx[i] = (smoothed[i + 1] - smoothed[i - 1]) * inner[i];
                gy[i] = (smoothed[i + w] - smoothed[i - w]) * inner[i];
            }
        }

        let share = box_mean(&inner, w, h, SLOPE_WINDOW);
        for g in [&mut gx, &mut gy] {
            let mean = box_mean(g, w, h, SLOPE_WINDOW);
            for i in 0..w * h {
                g[i] = (g[i] - mean[i] / share[i].max(1e-3)) * inner[i];
            }
        }

        let limit = strong(&gx, &gy, &inner);
        let mut vectors: Vec<[f32; 2]> = gx.iter().zip(&gy).map(|(x, y)| doubled(*x, *y, limit)).collect();
        let power: Vec<f32> = vectors.iter().map(|v| v[0] * v[0] + v[1] * v[1]).collect();
        let least = (power.iter().sum::<f32>() / power.len().max(1) as f32).sqrt() * 1e-2;
        let local = box_mean(&power, w, h, CONTRAST_WINDOW);

        for (v, p) in vectors.iter_mut().zip(local) {
            let scale = 1.0 / p.max(0.0).sqrt().max(least).max(1e-12);
            *v = [v[0] * scale, v[1] * scale];
        }

        Self {
            width: w,
            height: h,
            vectors,
        }
    }

    /// The strongest edges, at most `count`: pixel number and vector, ascending by pixel.
    pub fn strongest(&self, count: usize) -> Vec<(usize, [f32; 2])> {
        let power = |v: &[f32; 2]| v[0] * v[0] + v[1] * v[1];
        let mut all: Vec<(usize, [f32; 2])> = self.vectors.iter().copied().enumerate().collect();
        all.retain(|(_, v)| power(v) > 0.0);
        all.sort_by(|a, b| power(&b.1).total_cmp(&power(&a.1)).then(a.0.cmp(&b.0)));
        all.truncate(count);
        all.sort_by_key(|(i, _)| *i);
        all
    }
}

/// The vector of twice the angle, its length limited.
fn doubled(x: f32, y: f32, limit: f32) -> [f32; 2] {
    let length = x.hypot(y);
    if length <= 0.0 {
        return [0.0; 2];
    }
    let scale = length.min(limit) / (length * length);
    [(x * x - y * y) * scale, 2.0 * x * y * scale]
}

/// The length that a tenth of the gradients exceed: stronger ones count no more.
fn strong(gx: &[f32], gy: &[f32], inner: &[f32]) -> f32 {
    let lengths = gx.iter().zip(gy).zip(inner).filter(|(_, i)| **i > 0.0);
    let mut lengths: Vec<f32> = lengths.map(|((x, y), _)| x.hypot(*y)).collect();
    lengths.sort_by(f32::total_cmp);
    lengths.get(lengths.len() * 9 / 10).copied().unwrap_or(0.0)
}

/// Three box filters in a row are nearly a Gaussian.
fn smooth(values: &[f32], width: usize, height: usize) -> Vec<f32> {
    let once = box_mean(values, width, height, 1);
    box_mean(&box_mean(&once, width, height, 1), width, height, 1)
}

/// Mean over a square of half width `r`, zero beyond the border.
pub(super) fn box_mean(values: &[f32], width: usize, height: usize, r: usize) -> Vec<f32> {
    let along = running(values, height, width, 1, width, r);
    running(&along, width, height, width, 1, r)
}

/// Running mean along lines: `lines` of `length` values, `step` apart within a line, `stride` from line to
/// line.
fn running(values: &[f32], lines: usize, length: usize, step: usize, stride: usize, r: usize) -> Vec<f32> {
    let mut out = vec![0.0; values.len()];
    let norm = 1.0 / (2 * r + 1) as f64;
    for line in 0..lines {
        let at = |k: usize| line * stride + k * step;
        let mut sum: f64 = (0..r.min(length)).map(|k| f64::from(values[at(k)])).sum();
        for k in 0..length {
            if k + r < length {
                sum += f64::from(values[at(k + r)]);
            }
            if k > r {
                sum -= f64::from(values[at(k - r - 1)]);
            }
            out[at(k)] = (sum * norm) as f32;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_running_mean_is_the_mean_of_a_square() {
        let (w, h, r) = (9usize, 7usize, 2usize);
        let values: Vec<f32> = (0..w * h).map(|i| ((i * 37) % 11) as f32).collect();
        let mean = box_mean(&values, w, h, r);
        for y in 0..h {
            for x in 0..w {
                let mut sum = 0.0;
                for yy in y.saturating_sub(r)..=(y + r).min(h - 1) {
                    for xx in x.saturating_sub(r)..=(x + r).min(w - 1) {
                        sum += values[yy * w + xx];
                    }
                }
                assert!((mean[y * w + x] - sum / 25.0).abs() < 1e-4, "{x} {y}");
            }
        }
    }

    #[test]
    fn dark_lines_and_bright_lines_have_the_same_edges() {
        let (width, height) = (80, 60);
        let line = |sign: f32| {
            let value = |i: usize| if (i % width) % 20 < 2 { sign } else { 0.0 };
            Edges::of(&Map {
                width,
                height,
                values: (0..width * height).map(value).collect(),
            })
        };
        let (dark, bright) = (line(-1.0), line(1.0));
        for (a, b) in dark.vectors.iter().zip(&bright.vectors) {
            assert!((a[0] - b[0]).abs() < 1e-4 && (a[1] - b[1]).abs() < 1e-4);
        }
    }
}
