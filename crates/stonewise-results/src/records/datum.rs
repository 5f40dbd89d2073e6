//! What is known about the registration of a later epoch, and so about motions that all stones share.

use nalgebra::{Matrix3, Matrix6, Point3, Vector3, Vector6};
use serde::{Deserialize, Serialize};
use std::fmt;
use stonewise_base::messages::{Said, Translations, recorded};
use stonewise_base::report_params::Language;
use stonewise_core::geometry::{SmallMotion, lever};

/// Where the error of an epoch's registration is known from, in order of precedence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DatumState {
    /// From areas that did not move.
    Stable,
    /// Stated by the project.
    Stated,
    /// From how stations and strips of one epoch differ.
    Sources,
    /// From other instruments, together with what else is known.
    Instruments,
    /// Nothing is known: uncertainties hold for motions against the common rigid motion of the measured
    /// stones.
    Unknown,
}

impl DatumState {
    /// The word in files.
    pub fn word(self) -> &'static str {
        match self {
            Self::Stable => "stable",
            Self::Stated => "stated",
            Self::Sources => "sources",
            Self::Instruments => "instruments",
            Self::Unknown => "unknown",
        }
    }
}

impl fmt::Display for DatumState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// The registration of a later epoch against the first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Datum {
    /// Where the error is known from.
    pub state: DatumState,
    /// Place that the covariance refers to, world, metres.
    pub centre: [f64; 3],
    /// Covariance of the registration error at the centre as (shift x, y, z; rotation vector x, y, z), m^2, m
    /// rad, rad^2; absent where the state is unknown.
    pub covariance_6x6: Option<[[f64; 6]; 6]>,
    /// Where the state is unknown: the common rigid motion of the measured stones that motions are tested
    /// against, as (shift at the centre x, y, z; rotation vector x, y, z), m, rad.
    #[serde(default)]
    pub common_motion: Option<[f64; 6]>,
    /// The registration error, likewise about the centre, that was taken off the motions because instruments show it;
    /// what sources and stable areas show is part of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub taken_off: Option<[f64; 6]>,
    /// Errors of single stations and strips, where they were estimated.
    pub sources: Vec<SourceError>,
    /// What is known about the datum, in one sentence.
    pub note: String,
    /// The sentence in other languages; in a record, only in that of its report.
    #[serde(default, skip_serializing_if = "Translations::is_empty")]
    pub translations: Translations,
}

/// The estimated error of one station or strip against the mean of its epoch's sources, world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SourceError {
    /// Name of its epoch.
    pub epoch: String,
    /// Name of the source: file and point source id, or scan of an E57, PTX or PTS.
    pub source: String,
    /// Estimated error in the middle of what it shows, metres.
    pub error_m: [f64; 3],
    /// Standard deviation of the estimate per axis, metres.
    pub sd_m: [f64; 3],
}

impl Datum {
    /// A registration of which nothing is known.
    pub fn unknown(centre: &Point3<f64>, note: impl Into<Said>) -> Self {
        let note = note.into();
        Self {
            state: DatumState::Unknown,
            centre: centre.coords.into(),
            covariance_6x6: None,
            common_motion: None,
            taken_off: None,
            sources: Vec::new(),
            note: note.english,
            translations: note.translations,
        }
    }

    /// A registration whose error has this covariance at the centre, see [`Self::covariance_6x6`].
    pub fn known(
        state: DatumState,
        centre: &Point3<f64>,
        covariance: &Matrix6<f64>,
        note: impl Into<Said>,
    ) -> Self {
        let note = note.into();
        Self {
            state,
            centre: centre.coords.into(),
            covariance_6x6: Some(std::array::from_fn(|i| {
                std::array::from_fn(|j| covariance[(i, j)])
            })),
            common_motion: None,
            taken_off: None,
            sources: Vec::new(),
            note: note.english,
            translations: note.translations,
        }
    }

    /// Adds the common rigid motion that motions are tested against; only where nothing else is
    /// known.
    pub fn against(mut self, common: Option<&SmallMotion>) -> Self {
        if self.state == DatumState::Unknown {
            let centre = Point3::from(self.centre);
            self.common_motion = common.map(|common| {
                let shift = common.at(&centre);
                let turn = common.motion.fixed_rows::<3>(3);
                [shift.x, shift.y, shift.z, turn[0], turn[1], turn[2]]
            });
        }
        self
    }

    /// [`Self::note`] in the languages that there are words of it in.
    pub fn said(&self) -> Said {
        Said {
            code: Some("datum".to_owned()),
            english: self.note.clone(),
            translations: self.translations.clone(),
        }
    }

    /// The registration as a record keeps it whose report is in this language.
    pub fn recorded(self, language: Language) -> Self {
        Self {
            translations: recorded(self.translations, language),
            ..self
        }
    }

    /// Whether sources or stable areas show the error, so that it can be taken off the motions.
    pub fn is_estimated(&self) -> bool {
        matches!(self.state, DatumState::Stable | DatumState::Sources)
    }

    /// Covariance of the registration error at the centre, see [`Self::covariance_6x6`].
    pub fn covariance(&self) -> Option<Matrix6<f64>> {
        let rows = self.covariance_6x6.as_ref()?;
        Some(Matrix6::from_fn(|i, j| rows[i][j]))
    }

    /// Covariance of the registration error at a place, m^2, world; `None` where nothing is known.
    pub fn covariance_at(&self, place: &Point3<f64>) -> Option<Matrix3<f64>> {
        let covariance = self.covariance()?;
        let lever = lever(&(place - Point3::from(self.centre)));
        Some(lever * covariance * lever.transpose())
    }

    /// The error at a place that was taken off because instruments show it, metres, world.
    pub fn taken_off_at(&self, place: &Point3<f64>) -> Option<Vector3<f64>> {
        let error = Vector6::from(self.taken_off?);
        Some(lever(&(place - Point3::from(self.centre))) * error)
    }

    /// Covariance of the rotation vector of the registration error, rad^2; `None` where the state is unknown.
    pub fn rotation_covariance(&self) -> Option<Matrix3<f64>> {
        let rows = self.covariance_6x6.as_ref()?;
        Some(Matrix3::from_fn(|i, j| rows[3 + i][3 + j]))
    }

    /// The common rigid motion at a place, metres, world; `None` where motions are tested against the ground.
    pub fn common_motion_at(&self, place: &Point3<f64>) -> Option<Vector3<f64>> {
        let motion = Vector6::from(self.common_motion?);
        Some(lever(&(place - Point3::from(self.centre))) * motion)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_grows_with_the_distance_from_the_centre() {
        // A rotation about z with a standard deviation of 1 mrad: 4 mm across an arm of 4 m.
        let covariance = Matrix6::from_diagonal(&[1e-6, 1e-6, 1e-6, 0.0, 0.0, 1e-6].into());
        let centre = Point3::new(100.0, 200.0, 50.0);
        let datum = Datum::known(DatumState::Stable, &centre, &covariance, String::new());
        let there = datum.covariance_at(&(centre + Vector3::x() * 4.0)).unwrap();
        assert!((there[(1, 1)] - 1e-6 - 16e-6).abs() < 1e-15, "{there}");
        assert!((there[(0, 0)] - 1e-6).abs() < 1e-15 && (there[(2, 2)] - 1e-6).abs() < 1e-15);
        assert!(
            Datum::unknown(&centre, String::new())
                .covariance_at(&centre)
                .is_none()
        );
    }
}
