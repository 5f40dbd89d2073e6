//! One stone from photo to photo.

use super::matching::{FaceCells, Match, Template, Warp};
use super::params::{PhotoParams, WINDOW_SDS};
use super::patch::{FaceMotion, Patch, Placed};
use super::photo::{Chip, Photo};
use super::surface::Surface;
use crate::registration::points::PairPoints;
use nalgebra::{Matrix2, Matrix3, Vector2};
use serde::{Deserialize, Serialize};

/// Rounds in which the template of the first epoch follows its photos.
const TEMPLATES: usize = 3;
/// Rounds in which the second epoch's patches follow the stone.
const ROUNDS: usize = 3;
/// A stone that is found within this of where its patches were taken needs no other patches, metres: relief and parallax of that
/// distance make less than a tenth of a millimetre.
const NEAR_M: f64 = 0.002;
/// Error of a pose for which photos of one epoch are searched, pixels: several times what bundle adjustments leave.
const POSE_REACH_PX: f64 = 4.0;
/// Distance in which a least-squares match may end from its start, cells: within the grain that smoothing leaves.
const PULL_IN: f64 = 4.0;

/// Where a photo shows a stone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sight {
    pub photo: usize,
    /// Shift in the face against the template, as if the stone had not moved, metres.
    pub shift: Vector2<f64>,
    /// Covariance of the shift, m^2, formal.
    pub covariance: Matrix2<f64>,
    /// Turn in the face, radians.
    pub turn: f64,
    /// Strains of the face along, up and across, which a rigid stone cannot have.
    pub strain: [f64; 3],
    /// Shift per height above the face.
    pub parallax: [f64; 2],
    pub correlation: f64,
}

/// Why photos say nothing of a stone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PhotoStatus {
    /// They measure it.
    Tracked,
    /// Too few photos show it in one of the epochs.
    FewPhotos,
    /// Too little of its face is left within the rim.
    SmallFace,
    /// Photos of one epoch do not agree with each other.
    NoTemplate,
    /// The second epoch's photos do not show the template.
    NotFound,
}

/// What the photos show of a stone.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    pub status: PhotoStatus,
    pub sights: Vec<Sight>,
    /// Place on the face that shifts are those of, metres: along, up.
    pub place: [f64; 2],
    /// Root mean square reach of the face around that place, metres.
    pub reach: [f64; 2],
    /// Area of the face without its rim, m^2.
    pub area_m2: f64,
    /// The motion about which patches of the second epoch were taken.
    pub start: FaceMotion,
}

/// A stone to be tracked.
pub(crate) struct Tracker<'a> {
    pub pair: &'a PairPoints,
    pub face_from_world: &'a Matrix3<f64>,
    /// Where the clouds put it.
    pub start: FaceMotion,
    /// How far it is sought from there, metres.
    pub search_m: f64,
    pub photos: &'a [Photo],
    pub chips: &'a [Chip],
    pub params: &'a PhotoParams,
}

impl Tracker<'_> {
    pub fn track(&self) -> Track {
        let mut track = Track {
            status: PhotoStatus::Tracked,
            sights: Vec::new(),
            place: [0.0; 2],
            reach: [0.0; 2],
            area_m2: 0.0,
            start: self.start,
        };
        if let Err(status) = self.run(&mut track) {
            track.status = status;
            track.sights.clear();
        }
        track
    }

    fn run(&self, track: &mut Track) -> Result<(), PhotoStatus> {
        let chips = [0, 1].map(|epoch| -> Vec<&Chip> {
            let is_of = |c: &&Chip| {
                self.photos
                    .get(c.photo as usize)
                    .is_some_and(|p| p.epoch == epoch)
            };
            self.chips.iter().filter(is_of).collect()
        });
        if chips.iter().any(|c| c.len() < self.params.min_photos) {
            return Err(PhotoStatus::FewPhotos);
        }
        let pixel_m = self.pixel_m().ok_or(PhotoStatus::FewPhotos)?;
        let window_m = self.params.normalise_m;
        let margin_m = self.search_m + WINDOW_SDS * window_m;
        let surface = Surface::new(self.pair, self.face_from_world, pixel_m, margin_m, self.params)
            .ok_or(PhotoStatus::SmallFace)?;
        let face = FaceCells::new(&surface);
        track.place = surface.middle;
        track.reach = surface.reach;
        track.area_m2 = face.count() as f64 * surface.cell_m * surface.cell_m;
        let placed = Placed {
            surface: &surface,
            centroid: self.pair.centroid,
            face_from_world: self.face_from_world,
        };
        let patches = |epoch: usize, motion: &FaceMotion| -> Vec<Patch> {
            chips[epoch]
                .iter()
                .map(|c| placed.patch(&self.photos[c.photo as usize], c, motion, window_m))
                .collect()
        };
        let still = FaceMotion {
            translation: nalgebra::Vector3::zeros(),
            rotation: nalgebra::Vector3::zeros(),
        };
        let first = self.template(&patches(0, &still), &face, &surface);
        let (template, ones) = first.ok_or(PhotoStatus::NoTemplate)?;
        if ones.iter().flatten().count() < self.params.min_photos {
            return Err(PhotoStatus::NoTemplate);
        }
        let mut reach = (self.search_m / surface.cell_m).ceil() as isize;
        let mut twos = Vec::new();
        for _ in 0..ROUNDS {
            let list = patches(1, &track.start);
            let views: Vec<&Patch> = list.iter().collect();
            let near = face.best_shift(&template, &views, &surface, reach);
            let near = near.ok_or(PhotoStatus::NotFound)?;
            twos = list
                .iter()
                .map(|patch| {
                    let found = face.matched(&template, patch, &surface, Warp::shift(near), PULL_IN)?;
                    (found.correlation >= self.params.min_correlation).then_some(found)
                })
                .collect::<Vec<Option<Match>>>();
            if twos.iter().flatten().count() < self.params.min_photos {
                return Err(PhotoStatus::NotFound);
            }
            let shift = median_shift(&twos) * surface.cell_m;
            if shift.norm() < NEAR_M {
                break;
            }
            track.start.translation.x += shift.x;
            track.start.translation.y += shift.y;
            reach = PULL_IN as isize;
        }
        for (epoch, matches) in [ones, twos].iter().enumerate() {
            for (chip, found) in chips[epoch].iter().zip(matches) {
                track.sights.extend(
                    found.and_then(|m| self.sight(&surface, chip.photo as usize, epoch, &track.start, &m)),
                );
            }
        }
        Ok(())
    }

    /// Median size of a pixel on the face, metres.
    fn pixel_m(&self) -> Option<f64> {
        let axis = |r: usize| self.face_from_world.row(r).transpose();
        let mut sizes: Vec<f64> = self
            .chips
            .iter()
            .filter_map(|c| {
                self.photos
                    .get(c.photo as usize)?
                    .pixel_m(&self.pair.centroid, &axis(0), &axis(1))
            })
            .collect();
        crate::statistics::upper_median(&mut sizes)
    }

    /// The mean of the first epoch's photos brought onto each other, and how each lies on it.
    fn template(
        &self,
        patches: &[Patch],
        face: &FaceCells,
        surface: &Surface,
    ) -> Option<(Template, Vec<Option<Match>>)> {
        let shown = |i: usize| -> usize {
            let valid = &patches[i].valid;
            (0..valid.len())
                .filter(|&k| surface.inside[k] && valid[k])
                .count()
        };
        // The photo that most others agree with comes first; among equals the one that shows most of the face.
        let mut references: Vec<usize> = (0..patches.len()).collect();
        references.sort_by_key(|&i| (std::cmp::Reverse(shown(i)), i));
        let mut best: Option<Vec<Option<Match>>> = None;
        for reference in references {
            let still = Warp::shift(Vector2::zeros());
            let template = Template::new(face.warped(&patches[reference], surface, &still), surface);
            let found = self.matches(&template, patches, &[], face, surface);
            let count = |m: &[Option<Match>]| m.iter().flatten().count();
            if best.as_ref().is_none_or(|b| count(&found) > count(b)) {
                best = Some(found);
            }
            if best.as_ref().is_some_and(|b| count(b) == patches.len()) {
                break;
            }
        }
        let mut matches = best?;
        let mut template = Template::new(mean(patches, &matches, face, surface)?, surface);
        for round in 1..TEMPLATES {
            matches = self.matches(&template, patches, &matches, face, surface);
            if round + 1 < TEMPLATES {
                template = Template::new(mean(patches, &matches, face, surface)?, surface);
            }
        }
        Some((template, matches))
    }

    /// Matches photos of one epoch with a template, from where they lay on it before.
    fn matches(
        &self,
        template: &Template,
        patches: &[Patch],
        before: &[Option<Match>],
        face: &FaceCells,
        surface: &Surface,
    ) -> Vec<Option<Match>> {
        let one = |(i, patch): (usize, &Patch)| {
            let start = match before.get(i).copied().flatten() {
                Some(found) => found.warp,
                None => Warp::shift(face.best_shift(
                    template,
                    &[patch],
                    surface,
                    POSE_REACH_PX.ceil() as isize,
                )?),
            };
            let found = face.matched(template, patch, surface, start, PULL_IN)?;
            (found.correlation >= self.params.min_correlation).then_some(found)
        };
        patches.iter().enumerate().map(one).collect()
    }

    fn sight(
        &self,
        surface: &Surface,
        photo: usize,
        epoch: usize,
        start: &FaceMotion,
        found: &Match,
    ) -> Option<Sight> {
        let cell = surface.cell_m;
        let moved = match epoch {
            0 => nalgebra::Vector3::zeros(),
            _ => start.at(surface.middle),
        };
        let local = nalgebra::Vector3::new(surface.middle[0], surface.middle[1], 0.0) + moved;
        let at = self.pair.centroid + self.face_from_world.transpose() * local;
        let parallax = self.photos[photo].parallax(&at, self.face_from_world)?;
        let apart = found.warp.matrix - Matrix2::identity();
        let shift =
            found.warp.shift * cell + Vector2::new(moved.x, moved.y) + Vector2::from(parallax) * moved.z;
        let turned = if epoch == 0 { 0.0 } else { start.rotation.z };
        Some(Sight {
            photo,
            shift,
            covariance: found.covariance * (cell * cell),
            turn: 0.5 * (apart[(1, 0)] - apart[(0, 1)]) + turned,
            strain: [
                apart[(0, 0)],
                apart[(1, 1)],
                0.5 * (apart[(0, 1)] + apart[(1, 0)]),
            ],
            parallax,
            correlation: found.correlation,
        })
    }
}

/// Median of the matches' shifts, cells, each coordinate by itself.
fn median_shift(matches: &[Option<Match>]) -> Vector2<f64> {
    Vector2::from_fn(|a, _| {
        let mut shifts: Vec<f64> = matches.iter().flatten().map(|m| m.warp.shift[a]).collect();
        crate::statistics::median(&mut shifts).unwrap_or(0.0)
    })
}

/// Mean of the warped photos, cell by cell; `None` without a match.
fn mean(patches: &[Patch], matches: &[Option<Match>], face: &FaceCells, surface: &Surface) -> Option<Patch> {
    let warped: Vec<Patch> = patches
        .iter()
        .zip(matches)
        .filter_map(|(patch, found)| Some(face.warped(patch, surface, &found.as_ref()?.warp)))
        .collect();
    if warped.is_empty() {
        return None;
    }
    let count = surface.heights.len();
    let of_cell = |k: usize| -> (f32, u16) {
        warped
            .iter()
            .filter(|w| w.valid[k])
            .fold((0.0, 0), |(s, n), w| (s + w.values[k], n + 1))
    };
    let cells: Vec<(f32, u16)> = (0..count).map(of_cell).collect();
    Some(Patch {
        values: cells
            .iter()
            .map(|(s, n)| if *n > 0 { s / f32::from(*n) } else { 0.0 })
            .collect(),
        valid: cells.iter().map(|(_, n)| *n > 0).collect(),
    })
}
