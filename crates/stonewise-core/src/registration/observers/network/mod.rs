//! How the photos from which a cloud was computed bend it.
//!
//! A stabiliser or a loose lens moves the principal point from photo to photo (image-variant interior orientation:
//! Tecklenburg, Luhmann and Hastedt 2001; Haig, Heipke and Wiggenhagen 2006). The bundle that gave the cameras did not
//! model it: it turned and shifted the photos until most of it was compensated, and the rest bends the cloud. The fields
//! h of the photos are therefore unknowns that were considered but not adjusted (Schmidt 1966; Bierman 1977). With A and
//! B the derivatives of image points by (poses, cameras) and by their place, F the field at the image points, and
//! P = I - B (B'B)^-1 B',
//!
//! ```text
//! (poses, cameras) = (A'PA)^-1 A'P F h        over the tie points of the bundle
//! place            = (B'B)^-1 B' (F h - A (poses, cameras))        over the photos of the epoch that see it
//! ```
//!
//! The places of the stones stand for the tie points: what h does depends little on their number. A rigid motion of all
//! stones is left out; it belongs to the datum.

mod bundle;
mod matching;
mod sight;
mod size;

use super::sight::SeenStone;
use crate::geometry::View;
use crate::registration::modes::{less_rigid, main_modes};
use crate::registration::random::Random;
use bundle::{Bundle, BundleEquations};
pub(crate) use matching::Matching;
use nalgebra::{DMatrix, Matrix3xX};
use rayon::prelude::*;
use sight::{FIELDS, Sight};
pub use size::NetworkShift;
use size::mean_square;
use std::collections::BTreeSet;
use std::ops::Range;

/// Most stones that serve as tie points.
const MOST_TIES: usize = 4000;
/// Fewest tie points that determine the pose of a photo: twice what it needs.
const LEAST_TIES: usize = 6;
/// More fields than this are replaced by as many draws of them, whose covariance has errors of 7 %.
const MOST_FIELDS: usize = 400;

/// The photos from which clouds were computed.
#[derive(Clone, Debug)]
pub struct PhotoNetwork {
    /// Photos of the reference and of the later epoch; none where the epoch's cloud does not come from photos.
    pub photos: [Vec<View>; 2],
    /// Whether one bundle adjusted the photos of both epochs.
    pub is_joint: bool,
    /// What photos show of tracked stones, from which the size of the fields follows; without any, it is that of the
    /// class.
    pub shifts: Vec<NetworkShift>,
}

impl PhotoNetwork {
    /// Displacements of the stones, later epoch less reference, by independent unknowns of variance one: one matrix a
    /// stone with a column for each unknown, world, metres. `None` where no photos see the stones or the numbers fail.
    ///
    /// Cost: cubic in the number of photos.
    pub(super) fn modes(&self, stones: &[SeenStone]) -> Option<Vec<Matrix3xX<f64>>> {
        let seen = self.sights(stones);
        let fields = fields(self.photos.iter().map(Vec::len).sum());
        let first_later = self.photos[0].len();
        let epochs = [0..first_later, first_later..first_later + self.photos[1].len()];
        let bundle = |photos: &Range<usize>| self.bundle(photos.clone(), &seen, &fields);
        let bundles = match self.is_joint {
            true => vec![bundle(&(0..epochs[1].end))],
            false => epochs.iter().map(bundle).collect(),
        };
        if bundles.iter().all(Option::is_none) {
            return None;
        }

        let mut apart = vec![Matrix3xX::zeros(fields.ncols()); stones.len()];
        for ((bundle, photos), sign) in bundles.iter().cycle().zip(&epochs).zip([-1.0, 1.0]) {
            let Some(bundle) = bundle.as_ref().filter(|_| !photos.is_empty()) else {
                continue;
            };
            let place = |sights: &Vec<Sight>| {
                let of_epoch: Vec<&Sight> = sights.iter().filter(|s| photos.contains(&s.photo)).collect();
                bundle.displacement(&of_epoch, |s| s.shifts(&fields))
            };
            let places = nearest_where_none(stones, seen.par_iter().map(place).collect())?;
            apart
                .iter_mut()
                .zip(places)
                .for_each(|(sum, place)| *sum += place * sign);
        }
        let size = mean_square(&self.photos, &self.shifts, stones).sqrt();
        let apart = less_rigid(stones.iter().map(|s| s.centroid), apart)?;
        Some(main_modes(&apart).into_iter().map(|by| by * size).collect())
    }

    /// Errors of matching that neighbouring stones share; `None` where no photo sees a stone.
    pub(crate) fn matching(&self, stones: &[SeenStone]) -> Option<Matching> {
        Matching::seen(&self.sights(stones), self.photos[0].len())
    }

    /// The photos that see each stone; those that see too few stones are left out.
    fn sights(&self, stones: &[SeenStone]) -> Vec<Vec<Sight>> {
        let views: Vec<&View> = self.photos.iter().flatten().collect();
        let of_stone = |stone: &SeenStone| -> Vec<Sight> {
            let photos = views.iter().enumerate();
            photos.filter_map(|(k, view)| Sight::of(k, view, stone)).collect()
        };
        let mut seen: Vec<Vec<Sight>> = stones.par_iter().map(of_stone).collect();
        let mut counts = vec![0; views.len()];
        seen.iter().flatten().for_each(|s| counts[s.photo] += 1);
        seen.iter_mut()
            .for_each(|sights| sights.retain(|s| counts[s.photo] >= LEAST_TIES));
        seen
    }

    /// The bundle of these photos over the stones as tie points; `None` where no photo sees enough.
    fn bundle(&self, photos: Range<usize>, seen: &[Vec<Sight>], fields: &DMatrix<f64>) -> Option<Bundle> {
        let views: Vec<&View> = self.photos.iter().flatten().collect();
        let used: BTreeSet<usize> = seen.iter().flatten().map(|s| s.photo).collect();
        let used: Vec<usize> = used.range(photos).copied().collect();
        let mut equations = BundleEquations::new(&views, &used, fields.ncols());
        for sights in seen.iter().step_by(seen.len().div_ceil(MOST_TIES).max(1)) {
            let tie: Vec<&Sight> = sights.iter().collect();
            equations.add(&tie, |s| s.shifts(fields));
        }
        (!used.is_empty()).then(|| equations.solve()).flatten()
    }
}

/// The fields of so many photos by independent unknowns: each its own or, where these are too many, draws of all.
fn fields(photos: usize) -> DMatrix<f64> {
    let count = FIELDS * photos;
    if count <= MOST_FIELDS {
        return DMatrix::identity(count, count);
    }
    let mut random = Random::new(1);
    let scale = (MOST_FIELDS as f64).sqrt().recip();
    DMatrix::from_fn(count, MOST_FIELDS, |_, _| scale * random.normal())
}

/// Gives places whose rays do not intersect well what the nearest other place has; `None` where all are such.
fn nearest_where_none(
    stones: &[SeenStone],
    places: Vec<Option<Matrix3xX<f64>>>,
) -> Option<Vec<Matrix3xX<f64>>> {
    let known: Vec<usize> = (0..places.len()).filter(|k| places[*k].is_some()).collect();
    let nearest = |k: usize| {
        let distance = |other: &usize| (stones[*other].centroid - stones[k].centroid).norm_squared();
        let nearest = known.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        places[*nearest].clone()
    };
    (0..places.len())
        .map(|k| places[k].clone().or_else(|| nearest(k)))
        .collect()
}

#[cfg(test)]
mod tests;
