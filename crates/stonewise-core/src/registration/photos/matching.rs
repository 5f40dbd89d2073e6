//! Least-squares matching of a photo's patch with a stone's template (Gruen 1985, Ackermann 1984).
//!
//! The photo's values g at W(x) = x0 + A (x - x0) + t are those of the template T times a gain plus an
//! offset. Each step solves the linearised equations about the template, g(W(x)) = a T(x) + b + a grad T .
//! d(x), and composes W with the inverse of that step (Baker and Matthews 2004): gradients are those of the
//! template, which has the least noise.

use super::patch::Patch;
use super::surface::Surface;
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

/// Most steps: each halves the error at least where the start lies within the grain of the stone.
const STEPS: usize = 20;
/// A step below this ends the iteration, cells: a fifth of what is matched at best.
const SETTLED: f64 = 0.01;
/// Residuals beyond so many standard deviations lose weight (Huber 1964).
const HUBER: f64 = 2.0;
/// Cells that determine an affine match; fewer determine a shift.
const AFFINE_CELLS: usize = 250;
/// Cells that determine a shift.
const LEAST_CELLS: usize = 80;
/// Share of the face that a photo must show.
pub(super) const LEAST_SHARE: f64 = 0.6;
/// Strain of an affine match that is no longer that of the same face.
const LARGEST_STRAIN: f64 = 0.2;

/// A template with its gradients.
pub(crate) struct Template {
    pub patch: Patch,
    gradients: Vec<[f32; 2]>,
}

impl Template {
    pub fn new(patch: Patch, surface: &Surface) -> Self {
        let columns = surface.columns;
        let gradients = (0..patch.values.len())
            .map(|k| {
                let (c, r) = (k % columns, k / columns);
                if c == 0 || r == 0 || c + 1 == columns || r + 1 == surface.rows {
                    return [0.0; 2];
                }
                let v = &patch.values;
                [
                    0.5 * (v[k + 1] - v[k - 1]),
                    0.5 * (v[k + columns] - v[k - columns]),
                ]
            })
            .collect();
        Self { patch, gradients }
    }
}

/// x -> middle + matrix (x - middle) + shift, cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Warp {
    pub shift: Vector2<f64>,
    pub matrix: Matrix2<f64>,
}

impl Warp {
    pub fn shift(shift: Vector2<f64>) -> Self {
        Self {
            shift,
            matrix: Matrix2::identity(),
        }
    }

    /// Angle of its rotation, from the first axis to the second, radians: of the rotation nearest to the
    /// matrix.
    pub fn turn(&self) -> f64 {
        let m = &self.matrix;
        (m[(1, 0)] - m[(0, 1)]).atan2(m[(0, 0)] + m[(1, 1)])
    }

    pub(super) fn at(&self, d: Vector2<f64>) -> Vector2<f64> {
        self.matrix * d + self.shift
    }

    /// This warp after another.
    pub fn after(&self, first: &Self) -> Self {
        Self {
            matrix: self.matrix * first.matrix,
            shift: self.at(first.shift),
        }
    }

    /// This warp after the inverse of another.
    fn after_inverse_of(&self, step: &Self) -> Option<Self> {
        let inverse = step.matrix.try_inverse()?;
        let matrix = self.matrix * inverse;
        Some(Self {
            matrix,
            shift: self.shift - matrix * step.shift,
        })
    }
}

/// A photo matched with a template.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Match {
    pub warp: Warp,
    /// Whether the warp is affine: otherwise it is a shift, or its matrix is that of the start.
    pub is_affine: bool,
    /// Covariance of the shift, cells squared, of residuals taken as independent.
    pub covariance: Matrix2<f64>,
    pub correlation: f64,
}

/// Cells of the face with their place relative to its middle, in cells.
pub(crate) struct FaceCells {
    cells: Vec<(usize, Vector2<f64>)>,
    middle: Vector2<f64>,
}

impl FaceCells {
    pub fn new(surface: &Surface) -> Self {
        let middle = Vector2::from_fn(|a, _| (surface.middle[a] - surface.first[a]) / surface.cell_m);
        let place = |k: usize| Vector2::new((k % surface.columns) as f64, (k / surface.columns) as f64);
        let cells = (0..surface.inside.len())
            .filter(|&k| surface.inside[k])
            .map(|k| (k, place(k) - middle))
            .collect();
        Self { cells, middle }
    }

    pub fn count(&self) -> usize {
        self.cells.len()
    }

    /// Root mean square distance of the cells from the middle, cells.
    pub fn radius(&self) -> f64 {
        let square: f64 = self.cells.iter().map(|(_, d)| d.norm_squared()).sum();
        (square / self.count().max(1) as f64).sqrt()
    }

    /// A photo's values at the warped cells, on the grid.
    pub fn warped(&self, patch: &Patch, surface: &Surface, warp: &Warp) -> Patch {
        let place = |k: usize| Vector2::new((k % surface.columns) as f64, (k / surface.columns) as f64);
        let values: Vec<Option<f32>> = (0..patch.values.len())
            .map(|k| {
                let to = self.middle + warp.at(place(k) - self.middle);
                patch.sample(surface, to.x, to.y)
            })
            .collect();
        Patch {
            valid: values.iter().map(Option::is_some).collect(),
            values: values.into_iter().map(|v| v.unwrap_or(0.0)).collect(),
        }
    }

    /// Pairs of values (template, photo) at warped cells, with the cell's place and gradient.
    fn pairs(&self, template: &Template, patch: &Patch, surface: &Surface, warp: &Warp) -> Vec<Pair> {
        self.cells
            .iter()
            .filter(|(k, _)| template.patch.valid[*k])
            .filter_map(|(k, d)| {
                let to = self.middle + warp.at(*d);
                Some(Pair {
                    template: f64::from(template.patch.values[*k]),
                    photo: f64::from(patch.sample(surface, to.x, to.y)?),
                    gradient: template.gradients[*k].map(f64::from),
                    place: *d,
                })
            })
            .collect()
    }

    /// Matches a photo from a start: a shift first, then, where there are cells enough and it settles, an
    /// affine warp from there. `None` where the shift does not settle, leaves `reach` cells, or where the
    /// photo does not show the face.
    pub fn matched(
        &self,
        template: &Template,
        patch: &Patch,
        surface: &Surface,
        start: Warp,
        reach: f64,
    ) -> Option<Match> {
        let shifted = self.settled(template, patch, surface, start, reach, false)?;
        let affine = match self.count() >= AFFINE_CELLS {
            true => self.settled(template, patch, surface, shifted.warp, reach, true),
            false => None,
        };
        Some(affine.unwrap_or(shifted))
    }

    fn settled(
        &self,
        template: &Template,
        patch: &Patch,
        surface: &Surface,
        start: Warp,
        reach: f64,
        is_affine: bool,
    ) -> Option<Match> {
        let mut warp = start;
        for _ in 0..STEPS {
            let pairs = self.pairs(template, patch, surface, &warp);
            if pairs.len() < LEAST_CELLS || (pairs.len() as f64) < LEAST_SHARE * self.count() as f64 {
                return None;
            }
            let (step, covariance) = solve(&pairs, is_affine)?;
            warp = warp.after_inverse_of(&step)?;
            let strain = (warp.matrix - Matrix2::identity()).amax();
            if (warp.shift - start.shift).norm() > reach || strain > LARGEST_STRAIN {
                return None;
            }
            if step.shift.norm() < SETTLED {
                return Some(Match {
                    warp,
                    is_affine,
                    covariance,
                    correlation: correlation(&pairs),
                });
            }
        }
        None
    }
}

struct Pair {
    template: f64,
    photo: f64,
    gradient: [f64; 2],
    place: Vector2<f64>,
}

fn correlation(pairs: &[Pair]) -> f64 {
    let n = pairs.len() as f64;
    let (mt, mp) = (
        pairs.iter().map(|p| p.template).sum::<f64>() / n,
        pairs.iter().map(|p| p.photo).sum::<f64>() / n,
    );
    let (mut tt, mut tp, mut pp) = (0.0, 0.0, 0.0);
    for p in pairs {
        let (t, q) = (p.template - mt, p.photo - mp);
        tt += t * t;
        tp += t * q;
        pp += q * q;
    }
    if tt > 0.0 && pp > 0.0 {
        tp / (tt * pp).sqrt()
    } else {
        0.0
    }
}

/// The step of the warp, and the covariance of its shift.
fn solve(pairs: &[Pair], is_affine: bool) -> Option<(Warp, Matrix2<f64>)> {
    match is_affine {
        true => {
            let (x, covariance) = least_squares(pairs, |p| {
                let ([x, y], u, v) = (p.gradient, p.place.x, p.place.y);
                [1.0, p.template, x, y, x * u, x * v, y * u, y * v]
            })?;
            let strain = Matrix2::new(x[4], x[5], x[6], x[7]);
            step([x[1], x[2], x[3]], strain, covariance)
        }
        false => {
            let row = |p: &Pair| [1.0, p.template, p.gradient[0], p.gradient[1]];
            let (x, covariance) = least_squares(pairs, row)?;
            step([x[1], x[2], x[3]], Matrix2::zeros(), covariance)
        }
    }
}

/// The step that a gain, and a shift and a strain times this gain make.
fn step(
    [gain, x, y]: [f64; 3],
    strain: Matrix2<f64>,
    covariance: Matrix2<f64>,
) -> Option<(Warp, Matrix2<f64>)> {
    let warp = Warp {
        shift: Vector2::new(x, y) / gain,
        matrix: Matrix2::identity() + strain / gain,
    };
    (gain > 0.0).then(|| (warp, covariance / (gain * gain)))
}

/// Robust least squares of the photo's values on rows of offset, gain, shift and what else there is; the
/// unknowns, and the covariance of the shift.
fn least_squares<const N: usize>(
    pairs: &[Pair],
    row: impl Fn(&Pair) -> [f64; N],
) -> Option<(SVector<f64, N>, Matrix2<f64>)> {
    let mut weights = vec![1.0; pairs.len()];
    let mut found = None;
    for _ in 0..2 {
        let (mut normal, mut right) = (SMatrix::<f64, N, N>::zeros(), SVector::<f64, N>::zeros());
        for (p, w) in pairs.iter().zip(&weights) {
            let row = row(p);
            for i in 0..N {
                let weighted = w * row[i];
                right[i] += weighted * p.photo;
                for j in i..N {
                    normal[(j, i)] += weighted * row[j];
                }
            }
        }
        normal.fill_upper_triangle_with_lower_triangle();
        let inverse = normal.cholesky()?.inverse();
        let solution = inverse * right;
        let fitted = |p: &Pair| {
            row(p)
                .iter()
                .zip(solution.iter())
                .map(|(a, x)| a * x)
                .sum::<f64>()
        };
        let residuals: Vec<f64> = pairs.iter().map(|p| p.photo - fitted(p)).collect();
        let total: f64 = weights.iter().sum();
        let square: f64 = residuals.iter().zip(&weights).map(|(r, w)| w * r * r).sum();
        let sigma = (square / (total - N as f64).max(1.0)).sqrt();
        for (w, r) in weights.iter_mut().zip(&residuals) {
            *w = (HUBER * sigma / r.abs().max(f64::MIN_POSITIVE)).min(1.0);
        }
        let shift = inverse.fixed_view::<2, 2>(2, 2).into_owned();
        found = Some((solution, shift * (sigma * sigma)));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::search::Search;
    use super::*;
    use nalgebra::Rotation2;

    /// Grain of two to six cells, everywhere.
    fn texture(x: f64, y: f64) -> f64 {
        let waves = [
            [0.9, 0.3, 0.1],
            [-0.4, 1.1, 2.0],
            [0.6, -0.8, 0.7],
            [1.3, 0.7, 1.3],
            [-1.0, 0.5, 0.4],
        ];
        waves.iter().map(|[a, b, c]| (a * x + b * y + c).sin()).sum()
    }

    fn drawn(side: usize, value: impl Fn(f64, f64) -> f64) -> Patch {
        let at = |k: usize| value((k % side) as f64, (k / side) as f64) as f32;
        Patch {
            values: (0..side * side).map(at).collect(),
            valid: vec![true; side * side],
        }
    }

    /// A face whose texture was warped, with another gain and offset; what the match finds.
    fn found(side: usize, warp: &Warp, dirt: impl Fn(f64, f64) -> f64) -> Option<Match> {
        let surface = Surface::flat(side, 8);
        let face = FaceCells::new(&surface);
        let template = Template::new(drawn(side, texture), &surface);
        let middle = Vector2::repeat(0.5 * (side - 1) as f64);
        let back = warp.matrix.try_inverse()?;
        let patch = drawn(side, |x, y| {
            let from = middle + back * (Vector2::new(x, y) - middle - warp.shift);
            0.3 + 1.4 * texture(from.x, from.y) + dirt(x, y)
        });
        let reach = 6;
        let (start, _) = Search::new(&template, &surface).best_shift(&patch, reach)?;
        face.matched(&template, &patch, &surface, Warp::shift(start), 4.0)
    }

    #[test]
    fn a_known_shift_turn_and_stretch_are_found() {
        let warp = Warp {
            shift: Vector2::new(3.37, -1.82),
            matrix: Matrix2::new(1.01, -0.02, 0.03, 0.995),
        };
        let m = found(50, &warp, |_, _| 0.0).unwrap();
        assert!((m.warp.shift - warp.shift).norm() < 0.01, "{:?}", m.warp);
        assert!((m.warp.matrix - warp.matrix).norm() < 2e-3, "{:?}", m.warp);
        assert!(
            m.is_affine && (m.warp.turn() - 0.025).abs() < 1e-3,
            "{:?}",
            m.warp
        );
        assert!(m.correlation > 0.99, "{}", m.correlation);
    }

    #[test]
    fn a_stretch_does_not_change_the_angle_of_a_rotation() {
        let warp = Warp {
            shift: Vector2::zeros(),
            matrix: Rotation2::new(0.4).into_inner() * Matrix2::new(1.1, 0.05, 0.05, 0.9),
        };
        assert!((warp.turn() - 0.4).abs() < 1e-12);
    }

    #[test]
    fn small_faces_are_matched_by_a_shift_alone() {
        let warp = Warp::shift(Vector2::new(-2.41, 0.63));
        let m = found(28, &warp, |_, _| 0.0).unwrap();
        assert!((m.warp.shift - warp.shift).norm() < 0.02, "{:?}", m.warp);
        assert_eq!(m.warp.matrix, Matrix2::identity());
        assert!(!m.is_affine);
    }

    #[test]
    fn dirt_on_a_part_of_the_face_moves_the_match_little() {
        let warp = Warp::shift(Vector2::new(1.4, 0.6));
        let dirt = |x: f64, y: f64| {
            if x < 18.0 && y < 20.0 {
                6.0 * (0.35 * x - 0.2 * y).sin()
            } else {
                0.0
            }
        };
        let m = found(50, &warp, dirt).unwrap();
        assert!((m.warp.shift - warp.shift).norm() < 0.1, "{:?}", m.warp);
        assert!(m.correlation < 0.95);
    }

    #[test]
    fn the_formal_error_is_the_scatter_of_matches_of_noisy_photos() {
        let side = 50;
        let surface = Surface::flat(side, 8);
        let face = FaceCells::new(&surface);
        let template = Template::new(drawn(side, texture), &surface);
        let (mut square, mut expected) = (0.0, 0.0);
        for seed in 0..40_u64 {
            let noise = |x: f64, y: f64| {
                let number = seed * 1_000_000 + y as u64 * 1000 + x as u64;
                let uniform = |k: u64| crate::statistics::split_mix(number * 4 + k) as f64 / u64::MAX as f64;
                (0..4).map(uniform).sum::<f64>() - 2.0
            };
            let patch = drawn(side, |x, y| texture(x, y) + 0.5 * noise(x, y));
            let start = Warp::shift(Vector2::zeros());
            let m = face.matched(&template, &patch, &surface, start, 4.0).unwrap();
            square += m.warp.shift.norm_squared();
            expected += m.covariance.trace();
        }
        let ratio = square / expected;
        assert!((0.5..2.0).contains(&ratio), "{ratio}");
    }
}
