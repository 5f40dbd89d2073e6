//! Least-squares matching of a photo's patch with a stone's template (Gruen 1985, Ackermann 1984).
//!
//! The photo's values g at W(x) = x0 + A (x - x0) + t are those of the template T times a gain plus an
//! offset. Each step solves the linearised equations about the template, g(W(x)) = a T(x) + b + a grad T .
//! d(x), and composes W with the inverse of that step (Baker and Matthews 2004): gradients are those of the
//! template, which has the least noise.

use super::least_squares::Observed;
use super::patch::Patch;
use super::surface::Surface;
use nalgebra::{Matrix2, Vector2};
use std::ops::Range;

/// Maximum number of steps; each at least halves the error if the start lies within the grain of the stone.
const STEPS: usize = 20;
/// A step below this ends the iteration, cells: a fifth of the smallest error of a match.
const SETTLED: f64 = 0.01;
/// Minimum number of cells for an affine match; with fewer, only a shift is matched.
const AFFINE_CELLS: usize = 250;
/// Minimum number of cells for a shift.
const LEAST_CELLS: usize = 80;
/// Minimum share of the face that a photo must show.
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
    /// Whether an affine warp was matched; otherwise only the shift was, and the matrix is that of the start.
    pub is_affine: bool,
    /// Covariance of the shift, cells squared, of residuals taken as independent.
    pub covariance: Matrix2<f64>,
    pub correlation: f64,
}

/// Cells of the face, as runs of neighbours in rows.
pub(crate) struct FaceCells {
    runs: Vec<Run>,
    middle: Vector2<f64>,
    /// Columns and rows that hold them.
    pub columns: Range<usize>,
    pub rows: Range<usize>,
}

/// Cells side by side in a row.
struct Run {
    first: usize,
    count: usize,
    /// Place of the first relative to the middle of the face, cells.
    place: Vector2<f64>,
}

impl FaceCells {
    pub fn new(surface: &Surface) -> Self {
        let middle = Vector2::from_fn(|a, _| (surface.middle[a] - surface.first[a]) / surface.cell_m);
        let mut runs: Vec<Run> = Vec::new();
        let (mut columns, mut rows) = (surface.columns..0, surface.rows..0);
        for k in (0..surface.inside.len()).filter(|&k| surface.inside[k]) {
            let (column, row) = (k % surface.columns, k / surface.columns);
            columns = columns.start.min(column)..columns.end.max(column + 1);
            rows = rows.start.min(row)..rows.end.max(row + 1);
            match runs.last_mut() {
                Some(run) if column > 0 && run.first + run.count == k => run.count += 1,
                _ => runs.push(Run {
                    first: k,
                    count: 1,
                    place: Vector2::new(column as f64, row as f64) - middle,
                }),
            }
        }
        Self {
            runs,
            middle,
            columns,
            rows,
        }
    }

    pub fn count(&self) -> usize {
        self.runs.iter().map(|run| run.count).sum()
    }

    /// Root mean square distance of the cells from the middle, cells.
    pub fn radius(&self) -> f64 {
        let of_run = |run: &Run| -> f64 {
            let place = |k: usize| run.place + Vector2::new(k as f64, 0.0);
            (0..run.count).map(|k| place(k).norm_squared()).sum()
        };
        let square: f64 = self.runs.iter().map(of_run).sum();
        (square / self.count().max(1) as f64).sqrt()
    }

    /// A photo's values at the warped cells of the face and at those within `margin` cells of it.
    pub fn warped(&self, patch: &Patch, surface: &Surface, warp: &Warp, margin: usize) -> Patch {
        let around = |range: &Range<usize>, size: usize| {
            range.start.saturating_sub(margin)..(range.end + margin).min(size)
        };
        let columns = around(&self.columns, surface.columns);
        let mut values = vec![f32::NAN; patch.values.len()];
        for row in around(&self.rows, surface.rows) {
            let place = Vector2::new(columns.start as f64, row as f64) - self.middle;
            let line = row * surface.columns;
            let to = &mut values[line + columns.start..line + columns.end];
            self.sample_row(patch, surface, warp, place, to);
        }
        let valid: Vec<bool> = values.iter().map(|v| !v.is_nan()).collect();
        for (value, valid) in values.iter_mut().zip(&valid) {
            *value = if *valid { *value } else { 0.0 };
        }
        Patch::new(values, valid, surface.columns)
    }

    /// A photo's values at warped cells of a row, of which the first lies at `place` from the middle of the
    /// face; not a number where it shows none.
    fn sample_row(&self, patch: &Patch, surface: &Surface, warp: &Warp, place: Vector2<f64>, to: &mut [f32]) {
        let start = self.middle + warp.at(place);
        let step = warp.matrix.column(0).into_owned();
        patch.sample_line(surface, start.into(), step.into(), to);
    }

    /// Matches a photo from a start: a shift first, then, where there are cells enough and it settles, an
    /// affine warp from there. A start that is already affine is refined directly. `None` where the
    /// shift does not settle, leaves `reach` cells, or where the photo does not show the face.
    pub fn matched(
        &self,
        template: &Template,
        patch: &Patch,
        surface: &Surface,
        start: Warp,
        reach: f64,
    ) -> Option<Match> {
        let pair = Pair {
            face: self,
            template,
            patch,
            surface,
            reach,
        };
        let affine = |start: Warp| match self.count() >= AFFINE_CELLS {
            true => pair.settled::<AFFINE>(start),
            false => None,
        };
        let is_refined = start.matrix != Matrix2::identity();
        if let Some(refined) = is_refined.then(|| affine(start)).flatten() {
            return Some(refined);
        }
        let shifted = pair.settled::<SHIFT>(start)?;
        Some(affine(shifted.warp).unwrap_or(shifted))
    }
}

/// Unknowns of a match: offset and gain, the shift, and of an affine warp its strain.
const SHIFT: usize = 4;
const AFFINE: usize = 8;

/// A photo to be matched with a template.
struct Pair<'a> {
    face: &'a FaceCells,
    template: &'a Template,
    patch: &'a Patch,
    surface: &'a Surface,
    /// Distance from its start at which a match is given up, cells.
    reach: f64,
}

impl Pair<'_> {
    fn settled<const N: usize>(&self, start: Warp) -> Option<Match> {
        let mut warp = start;
        let mut observed = Observed::<N>::default();
        for _ in 0..STEPS {
            self.observe(&warp, &mut observed);
            let least = LEAST_CELLS.max((LEAST_SHARE * self.face.count() as f64).ceil() as usize);
            if observed.count < least {
                return None;
            }
            let (step, covariance) = step(&mut observed)?;
            warp = warp.after_inverse_of(&step)?;
            let strain = (warp.matrix - Matrix2::identity()).amax();
            if (warp.shift - start.shift).norm() > self.reach || strain > LARGEST_STRAIN {
                return None;
            }
            if step.shift.norm() < SETTLED {
                return Some(Match {
                    warp,
                    is_affine: N == AFFINE,
                    covariance,
                    correlation: observed.correlation(),
                });
            }
        }
        None
    }

    /// Collects the cells that both show, with the photo at warped places.
    fn observe<const N: usize>(&self, warp: &Warp, observed: &mut Observed<N>) {
        observed.clear();
        let template = self.template;
        let mut values = vec![0.0; self.surface.columns];
        for run in &self.face.runs {
            let values = &mut values[..run.count];
            self.face
                .sample_row(self.patch, self.surface, warp, run.place, values);
            for (along, value) in values.iter().enumerate() {
                let k = run.first + along;
                if value.is_nan() || !template.patch.valid[k] {
                    continue;
                }
                let ([x, y], u, v) = (
                    template.gradients[k],
                    (run.place.x + along as f64) as f32,
                    run.place.y as f32,
                );
                let all = [1.0, template.patch.values[k], x, y, x * u, x * v, y * u, y * v];
                observed.push(std::array::from_fn(|i| all[i]), *value);
            }
        }
    }
}

/// The step of the warp, and the covariance of its shift.
fn step<const N: usize>(observed: &mut Observed<N>) -> Option<(Warp, Matrix2<f64>)> {
    let (x, covariance) = observed.least_squares()?;
    let gain = x[1];
    let strain = match N == AFFINE {
        true => Matrix2::new(x[4], x[5], x[6], x[7]),
        false => Matrix2::zeros(),
    };
    let warp = Warp {
        shift: Vector2::new(x[2], x[3]) / gain,
        matrix: Matrix2::identity() + strain / gain,
    };
    (gain > 0.0).then(|| (warp, covariance / (gain * gain)))
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
        Patch::new((0..side * side).map(at).collect(), vec![true; side * side], side)
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
        let (start, _) = Search::new(&template, &surface, &face).best_shift(&patch, reach)?;
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
