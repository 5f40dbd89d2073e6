//! One stone from photo to photo.

use super::matching::{Match, Template, Warp};
use super::params::{OTHER_WINDOW, PhotoParams};
use super::patch::{Patch, normalised};
use super::photo::{ByRows, Chip, Photo};
use super::pictures::{FacePictures, Shown, pictures};
use super::placed::{FaceMotion, Placed};
use super::surface::Surface;
use super::template::{Face, Mean, median_shift};
use super::turn::turn_by_rotation;
use super::verify::{Verification, beyond_chance};
use crate::registration::points::PairPoints;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// Rounds in which the second epoch's patches follow the stone.
const ROUNDS: usize = 3;
/// A stone that is found within this of where its patches were taken needs no other patches, metres: relief
/// and parallax of that distance make less than a tenth of a millimetre.
const NEAR_M: f64 = 0.002;

/// Where a photo shows a stone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sight {
    pub photo: usize,
    /// Shift in the face against the template, as if the stone had not moved, metres.
    pub shift: Vector2<f64>,
    /// Covariance of the shift, m^2, formal.
    pub covariance: Matrix2<f64>,
    /// Turn of the picture in the face against the template, from the axis along to the axis up, as if the
    /// stone had not moved, radians; `None` where only a shift was matched.
    pub turn: Option<f64>,
    /// Shift per height above the face.
    pub parallax: [f64; 2],
    /// Effect of a shift of the photo's rows on the stone's face.
    pub by_rows: ByRows,
    pub correlation: f64,
}

/// Whether photos measure a stone and, if not, why.
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
    /// The way back, or another normalisation of contrast, leads elsewhere, or another place is as much alike.
    Ambiguous,
}

/// What the photos show of a stone.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    pub status: PhotoStatus,
    pub sights: Vec<Sight>,
    /// Place on the face to which the shifts refer, metres: along, up.
    pub place: [f64; 2],
    /// Root mean square distance of the face from that place, metres.
    pub radius_m: f64,
    /// By how many standard deviations the epochs' correlation lies above none.
    pub likeness: f64,
    /// Change of the shift between the epochs under another normalisation of contrast, metres.
    pub apart_m: [f64; 2],
    /// The motion about which patches of the second epoch were taken.
    pub start: FaceMotion,
    /// What was matched, if pictures are wanted.
    pub pictures: Option<FacePictures>,
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
    /// Edge of the pictures to be kept, pixels; zero for none.
    pub picture_px: usize,
}

/// The second epoch's photos of a stone.
struct Second {
    /// Their grey values on the moved face.
    grey: Vec<Vec<Option<f32>>>,
    /// Patches of these values with normalised contrast.
    patches: Vec<Patch>,
    /// How they lie on the template.
    matches: Vec<Option<Match>>,
}

/// Two places are the same one if they lie nearer to each other than this, metres: each is known to a pixel.
const SAME_PLACE_M: f64 = 0.005;
/// Difference of two likenesses that chance exceeds once in a hundred: 2.33 times the root of two variances.
const LIKELIER: f64 = 3.3;

impl Track {
    /// The track of a stone that was sought from several places; `own`: from the most probable one beforehand. The
    /// first that was found, unless its photos are clearly more alike at another. None counts where they are more
    /// alike at another place, but not clearly.
    pub fn best_of(own: Self, others: impl IntoIterator<Item = Self>) -> Self {
        let is_tracked = |t: &Self| t.status == PhotoStatus::Tracked;
        let mut others = others.into_iter().filter(is_tracked);
        let first = match is_tracked(&own) {
            true => own,
            false => match others.next() {
                Some(found) => found,
                None => return own,
            },
        };
        let (start, likeness) = (first.start.translation, first.likeness);
        let mut best = others.fold(first, |best, other| {
            match other.likeness.total_cmp(&best.likeness).is_gt() {
                true => other,
                false => best,
            }
        });
        let apart_m = (start - best.start.translation).xy().norm();
        if apart_m > SAME_PLACE_M && best.likeness - likeness < LIKELIER {
            best.status = PhotoStatus::Ambiguous;
            best.sights.clear();
            best.pictures = None;
        }
        best
    }
}

impl Tracker<'_> {
    pub fn track(&self) -> Track {
        let mut track = Track {
            status: PhotoStatus::Tracked,
            sights: Vec::new(),
            place: [0.0; 2],
            radius_m: 0.0,
            likeness: 0.0,
            apart_m: [0.0; 2],
            start: self.start,
            pictures: None,
        };
        if let Err(status) = self.run(&mut track) {
            track.status = status;
            track.sights.clear();
        }
        track
    }

    fn run(&self, track: &mut Track) -> Result<(), PhotoStatus> {
        let chips = self.chips_by_epoch()?;
        let pixel_m = self.pixel_m().ok_or(PhotoStatus::FewPhotos)?;
        let margin_m = self.params.margin_around_m(self.search_m);
        let surface = Surface::new(self.pair, self.face_from_world, pixel_m, margin_m, self.params)
            .ok_or(PhotoStatus::SmallFace)?;
        let face = Face::new(surface, pixel_m, self.search_m, self.params);
        track.place = face.surface.middle;
        track.radius_m = face.cells.radius() * face.surface.cell_m;
        let first = self.grey(&face.surface, &chips[0], &FaceMotion::none());
        let before = self.normalised(&first, &face.surface, 1.0);
        let mean = self.agreeing(face.template(&before))?;
        let second = self.followed(&face, &mean.template, &chips[1], &mut track.start)?;
        track.likeness =
            beyond_chance(&face, &mean.template, &second.matches).ok_or(PhotoStatus::NotFound)?;

        let others = [&first, &second.grey].map(|grey| self.normalised(grey, &face.surface, OTHER_WINDOW));
        let verification = Verification {
            face: &face,
            patches: [&before, &second.patches],
            first: &mean,
            second: &second.matches,
        };
        let apart = verification
            .verified([&others[0], &others[1]])
            .ok_or(PhotoStatus::Ambiguous)?;
        track.apart_m = (apart * face.surface.cell_m).into();

        for (epoch, matches) in [&mean.matches, &second.matches].into_iter().enumerate() {
            for (chip, found) in chips[epoch].iter().zip(matches) {
                track.sights.extend(
                    found.and_then(|m| {
                        self.sight(&face.surface, chip.photo as usize, epoch, &track.start, &m)
                    }),
                );
            }
        }

        let best = [
            self.best(&chips[0], &first, &before, &mean.matches),
            self.best(&chips[1], &second.grey, &second.patches, &second.matches),
        ];

        if let [Some(first), Some(second)] = best {
            let rim_m = self.params.rim_m;
            track.pictures = pictures(&face.surface, [first, second], self.picture_px, rim_m);
        }

        Ok(())
    }

    /// The photo of an epoch that correlates best with the template.
    fn best<'p>(
        &self,
        chips: &[&Chip],
        grey: &'p [Vec<Option<f32>>],
        patches: &'p [Patch],
        matches: &'p [Option<Match>],
    ) -> Option<Shown<'p>> {
        let shown = (0..chips.len()).filter_map(|i| {
            Some(Shown {
                photo: chips[i].photo as usize,
                grey: &grey[i],
                patch: &patches[i],
                found: matches[i].as_ref()?,
            })
        });
        shown.max_by(|a, b| a.found.correlation.total_cmp(&b.found.correlation))
    }

    fn chips_by_epoch(&self) -> Result<[Vec<&Chip>; 2], PhotoStatus> {
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
        Ok(chips)
    }

    /// Photos on the moved face.
    fn grey(&self, surface: &Surface, chips: &[&Chip], motion: &FaceMotion) -> Vec<Vec<Option<f32>>> {
        let placed = Placed {
            surface,
            centroid: self.pair.centroid,
            face_from_world: self.face_from_world,
        };
        chips
            .iter()
            .map(|c| placed.grey(&self.photos[c.photo as usize], c, motion))
            .collect()
    }

    /// Their contrast normalised in a window of `times` the usual width.
    fn normalised(&self, grey: &[Vec<Option<f32>>], surface: &Surface, times: f64) -> Vec<Patch> {
        let window_m = times * self.params.normalise_m;
        grey.iter().map(|g| normalised(g, surface, window_m)).collect()
    }

    /// Matches the second epoch's photos with the template. Patches are first taken about `start`, then again
    /// about where the stone was found.
    fn followed(
        &self,
        face: &Face,
        template: &Template,
        chips: &[&Chip],
        start: &mut FaceMotion,
    ) -> Result<Second, PhotoStatus> {
        let take = |motion: &FaceMotion| {
            let grey = self.grey(&face.surface, chips, motion);
            let patches = self.normalised(&grey, &face.surface, 1.0);
            (grey, patches)
        };
        let (mut grey, mut patches) = take(start);
        let own = self.agreeing(face.first_mean(&patches))?;
        let mut matches = self.found(face.matches_across(template, &patches, &own))?;

        for _ in 1..ROUNDS {
            let shifts = matches.iter().flatten().map(|m| m.warp.shift);
            let shift = median_shift(shifts).unwrap_or_else(Vector2::zeros);
            let shift_m = shift * face.surface.cell_m;
            if shift_m.norm() < NEAR_M {
                break;
            }
            start.translation.x += shift_m.x;
            start.translation.y += shift_m.y;
            (grey, patches) = take(start);
            let starts: Vec<Warp> = matches.iter().map(|m| start_after(m, shift)).collect();
            matches = self.found(Some(face.matches_from(template, &patches, &starts)))?;
        }

        Ok(Second {
            grey,
            patches,
            matches,
        })
    }

    /// The mean of an epoch's photos, if enough of them agree.
    fn agreeing(&self, mean: Option<Mean>) -> Result<Mean, PhotoStatus> {
        mean.filter(|m| self.are_enough(&m.matches))
            .ok_or(PhotoStatus::NoTemplate)
    }

    /// Matches of the second epoch with the template, if there are enough.
    fn found(&self, matches: Option<Vec<Option<Match>>>) -> Result<Vec<Option<Match>>, PhotoStatus> {
        matches
            .filter(|m| self.are_enough(m))
            .ok_or(PhotoStatus::NotFound)
    }

    fn are_enough(&self, matches: &[Option<Match>]) -> bool {
        matches.iter().flatten().count() >= self.params.min_photos
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

    fn sight(
        &self,
        surface: &Surface,
        photo: usize,
        epoch: usize,
        start: &FaceMotion,
        found: &Match,
    ) -> Option<Sight> {
        let cell = surface.cell_m;
        let taken = match epoch {
            0 => FaceMotion::none(),
            _ => *start,
        };
        let moved = taken.at(surface.middle);
        let local = Vector3::new(surface.middle[0], surface.middle[1], 0.0) + moved;
        let at = self.pair.centroid + self.face_from_world.transpose() * local;
        let parallax = self.photos[photo].parallax(&at, self.face_from_world)?;
        let by_rows = self.photos[photo].by_rows(&at, self.face_from_world)?;
        let shift =
            found.warp.shift * cell + Vector2::new(moved.x, moved.y) + Vector2::from(parallax) * moved.z;

        Some(Sight {
            photo,
            shift,
            covariance: found.covariance * (cell * cell),
            turn: found
                .is_affine
                .then(|| found.warp.turn() + (turn_by_rotation(parallax) * taken.rotation).x),
            parallax,
            by_rows,
            correlation: found.correlation,
        })
    }
}

/// Start of a match whose patch was taken again with the face moved by `shift`, cells.
fn start_after(found: &Option<Match>, shift: Vector2<f64>) -> Warp {
    match found {
        Some(found) => Warp {
            shift: found.warp.shift - shift,
            ..found.warp
        },
        None => Warp::shift(Vector2::zeros()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(status: PhotoStatus, place_m: f64, likeness: f64) -> Track {
        Track {
            status,
            sights: Vec::new(),
            place: [0.0; 2],
            radius_m: 0.1,
            likeness,
            apart_m: [0.0; 2],
            start: FaceMotion {
                translation: Vector3::new(place_m, 0.0, 0.0),
                ..FaceMotion::none()
            },
            pictures: None,
        }
    }

    #[test]
    fn another_place_counts_where_the_photos_are_clearly_more_alike() {
        use PhotoStatus::{Ambiguous, NotFound, Tracked};
        let best = |tracks: &[(PhotoStatus, f64, f64)]| {
            let mut tracks = tracks
                .iter()
                .map(|&(status, place, likeness)| track(status, place, likeness));
            let own = tracks.next().unwrap();
            let best = Track::best_of(own, tracks);
            (best.status, best.start.translation.x)
        };
        assert_eq!(
            best(&[(Tracked, 0.05, 6.0), (Tracked, 0.0, 12.0)]),
            (Tracked, 0.0)
        );
        assert_eq!(best(&[(Tracked, 0.05, 11.0), (Tracked, 0.0, 12.0)]).0, Ambiguous);
        assert_eq!(
            best(&[(Tracked, 0.05, 6.0), (Tracked, 0.0, 5.0)]),
            (Tracked, 0.05)
        );
        // Two searches that end at one place.
        assert_eq!(
            best(&[(Tracked, 0.001, 11.0), (Tracked, 0.0, 12.0)]),
            (Tracked, 0.0)
        );
        assert_eq!(
            best(&[(NotFound, 0.05, 20.0), (Tracked, 0.0, 5.0)]),
            (Tracked, 0.0)
        );
        assert_eq!(
            best(&[(NotFound, 0.05, 0.0), (NotFound, 0.0, 9.0)]),
            (NotFound, 0.05)
        );
        // The earlier of two that are equally alike.
        assert_eq!(
            best(&[(Tracked, 0.001, 9.0), (Tracked, 0.002, 9.0)]),
            (Tracked, 0.001)
        );
    }
}
