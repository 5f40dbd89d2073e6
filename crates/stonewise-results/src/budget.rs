//! Where the standard deviation of a motion comes from.

use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;
use std::str::FromStr;
use stonewise_core::geometry::FaceFrame;

/// Errors of one kind in the covariance of a stone's motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Term {
    /// Noise of the stone's own points and photos, what its neighbours leave open, and whether it is loose.
    Stone,
    /// Errors that the points of stones share over some length.
    Points,
    /// Poses of the photos in which the stone was tracked.
    Poses,
    /// Interior orientation of the photos from which clouds were computed.
    Photos,
    /// Scale of the epochs.
    Scale,
    /// Registration of the epochs: stations, strips, stable areas, what is stated.
    Registration,
    /// The common motion of the stones, which motions count from where the datum is unknown.
    CommonMotion,
}

impl Term {
    /// All of them, in the order of the files.
    pub const ALL: [Self; 7] = [
        Self::Stone,
        Self::Points,
        Self::Poses,
        Self::Photos,
        Self::Scale,
        Self::Registration,
        Self::CommonMotion,
    ];

    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Stone => "stone",
            Self::Points => "points",
            Self::Poses => "poses",
            Self::Photos => "photos",
            Self::Scale => "scale",
            Self::Registration => "registration",
            Self::CommonMotion => "common motion",
        }
    }
}

impl FromStr for Term {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let known = Self::ALL.into_iter().find(|term| term.name() == name);
        known.ok_or_else(|| format!("{name:?} is not a term of a budget"))
    }
}

/// Variance that counts as none, m^2: that of a nanometre, beside which sums of covariances are rounded.
const NOTHING_M2: f64 = 1e-18;

/// Variances that terms add to a motion along the wall, up and out, m^2. Their sum is the variance of the motion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Budget(BTreeMap<Term, Vector3<f64>>);

impl Budget {
    /// Of terms with covariances in world axes, on a face with this normal. Terms that add nothing are left out.
    pub fn of(normal: &Vector3<f64>, terms: &[(Term, Matrix3<f64>)]) -> Self {
        let face_from_world = FaceFrame::from_normal(normal).face_from_world();
        let mut budget = Self::default();
        for (term, covariance) in terms {
            let variances = (face_from_world * covariance * face_from_world.transpose()).diagonal();
            budget.add(*term, variances);
        }
        budget
    }

    /// From standard deviations, as files have them.
    pub fn from_sds(sds: impl IntoIterator<Item = (Term, Vector3<f64>)>) -> Self {
        let mut budget = Self::default();
        for (term, sd) in sds {
            budget.add(term, sd.component_mul(&sd));
        }
        budget
    }

    fn add(&mut self, term: Term, variances: Vector3<f64>) {
        if variances.amax() > NOTHING_M2 {
            *self.0.entry(term).or_default() += variances;
        }
    }

    /// Both together.
    #[must_use]
    pub fn with(&self, other: &Self) -> Self {
        let mut both = self.clone();
        other
            .0
            .iter()
            .for_each(|(term, variances)| both.add(*term, *variances));
        both
    }

    /// Without a term.
    #[must_use]
    pub fn without(mut self, term: Term) -> Self {
        self.0.remove(&term);
        self
    }

    /// Variances of a term; zero where it adds nothing.
    pub fn variances(&self, term: Term) -> Vector3<f64> {
        self.0.get(&term).copied().unwrap_or_default()
    }

    /// The sum of all terms.
    pub fn total(&self) -> Vector3<f64> {
        self.0.values().sum()
    }

    /// Standard deviations of the terms, in the order of the files.
    pub fn sds(&self) -> impl Iterator<Item = (Term, Vector3<f64>)> {
        self.0
            .iter()
            .map(|(term, variances)| (*term, variances.map(|v| v.max(0.0).sqrt())))
    }
}
