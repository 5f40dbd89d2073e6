//! The shape of an area that moved out of the wall or into it: bulge, lean or step.

use super::areas::{Area, Motion};
use super::body::Body;
use super::extent::{Extent, in_face};
use super::found::ZoneKind;
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeSet;
use std::f64::consts::FRAC_PI_4;

/// The shape that fits the motions of the stones in an area and beside it best, by weighted least squares. A cos^2 that
/// falls to half of its peak on the ellipse of the area is a bulge, a plane is a lean, the same motion of all its
/// stones and none beside it is a step. Each coefficient costs the logarithm of the number of stones (BIC, Schwarz
/// 1978); a shape with more coefficients than the area has stones is not tried. Stones beyond a crack do not count.
///
/// `motion`: that in which the area was found; `measured`, `sds`: motion of each stone and its standard deviation,
/// metres.
pub(super) fn shape(
    body: &Body,
    area: &Area,
    motion: &Motion,
    [measured, sds]: [&[f64]; 2],
    extent: &Extent,
) -> ZoneKind {
    let inside: BTreeSet<usize> = area.stones.iter().copied().collect();
    let of_peak = body.stones[area.stones[0]].joint.body;
    let is_of_body = |i: &usize| body.stones[*i].joint.body == of_peak;
    let stones: Vec<usize> = motion.around(area).into_iter().filter(is_of_body).collect();
    let Some(distance) = extent.distance() else {
        return ZoneKind::Other;
    };
    let cos2 = |i: usize| {
        (FRAC_PI_4 * distance(&in_face(body, area, i)).min(2.0))
            .cos()
            .powi(2)
    };
    let plane = |i: usize| {
        let place = in_face(body, area, i);
        [1.0, place.x, place.y]
    };
    let misfit = |columns: usize, row: &dyn Fn(usize, usize) -> f64| {
        if area.stones.len() < columns {
            return None;
        }
        let weight = |i: usize| 1.0 / sds[stones[i]].max(f64::MIN_POSITIVE);
        let design = DMatrix::from_fn(stones.len(), columns, |i, k| row(stones[i], k) * weight(i));
        let values = DVector::from_fn(stones.len(), |i, _| measured[stones[i]] * weight(i));
        let normal = (design.transpose() * &design).cholesky()?;
        let rest = &values - &design * normal.solve(&(design.transpose() * &values));
        Some(rest.norm_squared() + columns as f64 * (stones.len() as f64).ln())
    };
    let all = [
        (ZoneKind::Bulge, misfit(1, &|i, _| cos2(i))),
        (ZoneKind::Lean, misfit(3, &|i, k| plane(i)[k])),
        (ZoneKind::Step, misfit(1, &|i, _| f64::from(inside.contains(&i)))),
    ];
    let fitted = all.into_iter().filter_map(|(kind, misfit)| Some((kind, misfit?)));
    let best = fitted.min_by(|a, b| a.1.total_cmp(&b.1));
    best.map_or(ZoneKind::Other, |(kind, _)| kind)
}
