//! How far a wall as a whole has grown or shrunk in its own plane.

use crate::geometry::{FaceFrame, Plane};
use crate::statistics::upper_median;
use nalgebra::{Matrix2, Matrix3, Matrix3x2, Point3, RowVector2, Vector2, Vector3};

/// The uniform strain that fits displacements on a wall best, in the plane of the wall; positive where places
/// moved apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strain {
    /// Unit normal of the plane, sign arbitrary.
    pub normal: Vector3<f64>,
    /// Mean of the two principal strains.
    pub mean: f64,
    /// Standard deviation of `mean`.
    pub mean_sd: f64,
    /// The principal strain of the smaller size where both have the sign of `mean`; else the one of the other
    /// sign. A scale has both alike, a stretch in one direction alone has zero here.
    pub lesser: f64,
    /// Standard deviation of `lesser`.
    pub lesser_sd: f64,
}

/// Parts of the wall along, and of each of these up, that are left out in turn. Nine parts leave eight
/// degrees of freedom, and errors that are smooth over less than a third of the wall differ between them.
const PARTS: usize = 3;
/// Least number of stones: two in each part.
const LEAST_STONES: usize = 2 * PARTS * PARTS;
/// Walls less wide than this part of their length show no strain across: of one 200 m long, a strip of 20 cm.
const LEAST_WIDTH: f64 = 1e-3;
/// Rounds of reweighting; the weights of a wall with loose stones change by less than 1 % after ten.
const ROUNDS: usize = 20;
/// Residuals beyond this multiple of their median lose weight (Huber 1964): about 1.8 standard deviations of
/// two normal components.
const OUTLIER: f64 = 1.5;
/// Residuals below this are rounding, metres.
const LEAST_RESIDUAL_M: f64 = 1e-9;

impl Strain {
    /// The strain of a wall whose `places` moved by these displacements, metres, world.
    ///
    /// Displacements in the plane are fitted by a shift and a matrix of gradients; single stones that moved on
    /// their own lose weight (Huber 1964). The strain is the symmetric part of the gradients, so that
    /// rotations do not change it. Standard deviations follow from leaving out one part of the wall at a time
    /// (jackknife of blocks; Quenouille 1956, Kuensch 1989); errors that are smooth over the whole wall are not
    /// in them. `None` with fewer than 18 places, or where all lie about on a line. Cost: O(places).
    pub fn fit(places: &[Point3<f64>], displacements: &[Vector3<f64>]) -> Option<Self> {
        if places.len() < LEAST_STONES || places.len() != displacements.len() {
            return None;
        }
        let plane = Plane::fit(places)?;
        let [_, width, length] = plane.spread_m;
        if width < LEAST_WIDTH * length {
            return None;
        }
        let to_face = FaceFrame::from_normal(&plane.normal).face_from_world();
        let in_plane = |v: &Vector3<f64>| (to_face * v).xy();
        let places: Vec<Vector2<f64>> = places.iter().map(|p| in_plane(&(p - plane.centroid))).collect();
        let displacements: Vec<Vector2<f64>> = displacements.iter().map(in_plane).collect();
        let sums = weighted(&places, &displacements)?;
        let whole: Sums = sums.iter().copied().fold(Sums::default(), Sums::plus);
        let [mean, lesser] = whole.strain()?;
        let mut parts = [Sums::default(); PARTS * PARTS];
        for (sum, part) in sums.into_iter().zip(parts_of(&places)) {
            parts[part] = parts[part].plus(sum);
        }
        let without = parts.iter().map(|part| whole.less(part).strain());
        let without: Vec<[f64; 2]> = without.collect::<Option<_>>()?;
        Some(Self {
            normal: plane.normal,
            mean,
            mean_sd: jackknife_sd(without.iter().map(|s| s[0])),
            lesser,
            lesser_sd: jackknife_sd(without.iter().map(|s| s[1])),
        })
    }
}

/// Sums of the normal equations of shift and gradients: displacement = (1, along, up) x unknowns.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    information: Matrix3<f64>,
    right: Matrix3x2<f64>,
}

impl Sums {
    fn of(place: &Vector2<f64>, displacement: &Vector2<f64>, weight: f64) -> Self {
        let row = Vector3::new(1.0, place.x, place.y);
        Self {
            information: weight * row * row.transpose(),
            right: weight * row * RowVector2::new(displacement.x, displacement.y),
        }
    }

    fn plus(self, other: Self) -> Self {
        Self {
            information: self.information + other.information,
            right: self.right + other.right,
        }
    }

    fn less(&self, other: &Self) -> Self {
        Self {
            information: self.information - other.information,
            right: self.right - other.right,
        }
    }

    fn solved(&self) -> Option<Matrix3x2<f64>> {
        Some(self.information.cholesky()?.solve(&self.right))
    }

    /// Mean and lesser principal strain.
    fn strain(&self) -> Option<[f64; 2]> {
        let gradients: Matrix2<f64> = self.solved()?.fixed_view::<2, 2>(1, 0).into_owned();
        let mean = 0.5 * gradients.trace();
        let shear = 0.5 * (gradients[(0, 1)] + gradients[(1, 0)]);
        let radius = (0.5 * (gradients[(0, 0)] - gradients[(1, 1)])).hypot(shear);
        Some([mean, mean - radius.copysign(mean)])
    }
}

/// Normal equations of each place with the weight that it has at last.
fn weighted(places: &[Vector2<f64>], displacements: &[Vector2<f64>]) -> Option<Vec<Sums>> {
    let each = |weights: &[f64]| -> Vec<Sums> {
        let samples = places.iter().zip(displacements).zip(weights);
        samples.map(|((p, d), w)| Sums::of(p, d, *w)).collect()
    };
    let mut sums = each(&vec![1.0; places.len()]);
    for _ in 0..ROUNDS {
        let unknowns = sums.iter().copied().fold(Sums::default(), Sums::plus).solved()?;
        let residual = |(p, d): (&Vector2<f64>, &Vector2<f64>)| {
            (d - unknowns.tr_mul(&Vector3::new(1.0, p.x, p.y))).norm()
        };
        let residuals: Vec<f64> = places.iter().zip(displacements).map(residual).collect();
        let limit = OUTLIER * upper_median(&mut residuals.clone())?.max(LEAST_RESIDUAL_M);
        let weights: Vec<f64> = residuals.iter().map(|r| limit / r.max(limit)).collect();
        sums = each(&weights);
    }
    Some(sums)
}

/// The part of the wall that each place belongs to; all parts hold the same number of places, but for one.
fn parts_of(places: &[Vector2<f64>]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by(|&a, &b| places[a].x.total_cmp(&places[b].x).then(a.cmp(&b)));
    let mut parts = vec![0; places.len()];
    for (column, (start, end)) in thirds(order.len()).enumerate() {
        let column_order = &mut order[start..end];
        column_order.sort_by(|&a, &b| places[a].y.total_cmp(&places[b].y).then(a.cmp(&b)));
        for (row, (low, high)) in thirds(column_order.len()).enumerate() {
            for &place in &column_order[low..high] {
                parts[place] = PARTS * column + row;
            }
        }
    }
    parts
}

/// Start and end of each part of a row of this length.
fn thirds(count: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..PARTS).map(move |part| (part * count / PARTS, (part + 1) * count / PARTS))
}

/// Standard deviation of an estimate from its values without one part each.
fn jackknife_sd(without: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = (PARTS * PARTS) as f64;
    let mean = without.clone().sum::<f64>() / count;
    let squares: f64 = without.map(|value| (value - mean).powi(2)).sum();
    ((count - 1.0) / count * squares).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Rotation3, Unit};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const BASE: Point3<f64> = Point3::new(4.5e5, 5.6e6, 300.0);

    /// Stones of a wall of 4 x 3 m that leans and looks anywhere, with its axes along and up.
    fn wall() -> (Vec<Point3<f64>>, [Vector3<f64>; 2]) {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let turn = Rotation3::from_euler_angles(0.1, 0.2, 0.7);
        let [along, up] = [turn * Vector3::y(), turn * Vector3::z()];
        let mut place = |_| {
            let [a, u, out] = [4.0, 3.0, 0.05].map(|end| random.random_range(0.0..end));
            BASE + along * a + up * u + along.cross(&up) * out
        };
        ((0..150).map(&mut place).collect(), [along, up])
    }

    /// Displacements by a matrix of gradients.
    fn moved(places: &[Point3<f64>], gradients: &Matrix3<f64>) -> Vec<Vector3<f64>> {
        let shift = Vector3::new(0.01, -0.02, 0.005);
        places.iter().map(|p| shift + gradients * (p - BASE)).collect()
    }

    #[test]
    fn a_scale_is_found_beside_a_motion_of_the_whole_wall() {
        let (places, [along, up]) = wall();
        let turn = Rotation3::from_axis_angle(&Unit::new_normalize(along.cross(&up)), 1e-4);
        let gradients = turn.matrix() * 1.003 - Matrix3::identity();
        let strain = Strain::fit(&places, &moved(&places, &gradients)).unwrap();
        // The plane that is fitted to the stones leans against theirs by what their relief allows.
        assert!(
            (strain.mean - 0.003).abs() < 1e-7 && (strain.lesser - 0.003).abs() < 1e-7,
            "{strain:?}"
        );
        assert!(strain.mean_sd < 1e-7 && strain.lesser_sd < 1e-7, "{strain:?}");
    }

    #[test]
    fn principal_strains_are_told_apart() {
        let (places, [along, up]) = wall();
        let fit = |a: f64, u: f64, shear: f64| {
            let gradients =
                along * along.transpose() * a + up * up.transpose() * u + up * along.transpose() * shear;
            Strain::fit(&places, &moved(&places, &gradients)).unwrap()
        };
        // A crack that opens all over: one direction alone.
        let opened = fit(0.004, 0.0, 0.0);
        assert!(
            (opened.mean - 0.002).abs() < 1e-5 && opened.lesser.abs() < 1e-5,
            "{opened:?}"
        );
        // One end settles: no change of area, and principal strains of +- half the slope.
        let settled = fit(0.0, 0.0, 0.004);
        assert!(
            settled.mean.abs() < 1e-5 && (settled.lesser.abs() - 0.002).abs() < 1e-5,
            "{settled:?}"
        );
        let shrunk = fit(-0.001, -0.003, 0.0);
        assert!(
            (shrunk.mean + 0.002).abs() < 1e-5 && (shrunk.lesser + 0.001).abs() < 1e-5,
            "{shrunk:?}"
        );
    }

    #[test]
    fn stones_that_moved_on_their_own_do_not_change_it() {
        let (places, _) = wall();
        let mut displacements = moved(&places, &(Matrix3::identity() * 0.002));
        for displacement in displacements.iter_mut().step_by(20) {
            *displacement += Vector3::new(0.1, 0.1, 0.1);
        }
        let strain = Strain::fit(&places, &displacements).unwrap();
        assert!((strain.mean - 0.002).abs() < 2e-5, "{strain:?}");
    }

    /// The standard deviation against the scatter of many walls with independent errors.
    #[test]
    fn the_standard_deviation_is_the_scatter_of_estimates() {
        let (places, _) = wall();
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let mut fit = |_| {
            let mut draw = || (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>() * 1e-3;
            let noise = places
                .iter()
                .map(|_| Vector3::from_fn(|_, _| draw()))
                .collect::<Vec<_>>();
            Strain::fit(&places, &noise).unwrap()
        };
        let fits: Vec<Strain> = (0..300).map(&mut fit).collect();
        let scatter = (fits.iter().map(|s| s.mean.powi(2)).sum::<f64>() / 300.0).sqrt();
        let stated = (fits.iter().map(|s| s.mean_sd.powi(2)).sum::<f64>() / 300.0).sqrt();
        assert!((stated / scatter - 1.0).abs() < 0.15, "{stated} {scatter}");
    }

    #[test]
    fn few_stones_and_a_single_row_show_none() {
        let (places, [along, _]) = wall();
        let none = vec![Vector3::zeros(); 150];
        assert!(Strain::fit(&places[..17], &none[..17]).is_none());
        let row: Vec<_> = (0..30).map(|i| BASE + along * f64::from(i)).collect();
        assert!(Strain::fit(&row, &none[..30]).is_none());
    }
}
