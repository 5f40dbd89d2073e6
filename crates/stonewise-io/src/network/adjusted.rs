//! An adjusted network, and what readers of its formats share.

use crate::text::read_text;
use nalgebra::{DMatrix, Point3};
use std::path::{Path, PathBuf};

/// Of the largest eigenvalue, metres^2, what rounding to seven digits may make of one that is 0.
const ROUNDING: f64 = 1e-6;

/// An adjusted network: x to the east, y to the north, z up.
#[derive(Clone, Debug)]
pub struct Network {
    /// Its file, and the one of its covariance where that is another.
    pub files: Vec<PathBuf>,
    /// The points that x, y and z place, in the order of the file.
    pub points: Vec<NetworkPoint>,
    /// Covariance of the adjusted coordinates, m^2.
    pub covariance: DMatrix<f64>,
}

/// A point of a network.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkPoint {
    /// Its name.
    pub name: String,
    /// Where it is.
    pub place: Point3<f64>,
    /// Its coordinates along x, y and z; `None` where they are not adjusted.
    pub adjusted: [Option<AdjustedCoordinate>; 3],
}

/// A coordinate that was adjusted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdjustedCoordinate {
    /// Metres.
    pub value_m: f64,
    /// Its row in the covariance.
    pub row: usize,
}

/// What a file of a network cannot hold, and where.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}:{line}: {message}", .path.display())]
pub struct NetworkError {
    /// The file.
    pub path: PathBuf,
    /// Line, counted from 1.
    pub line: usize,
    /// What is wrong, and the fix.
    pub message: String,
}

/// What a reader found.
#[derive(Default)]
pub(super) struct Raw {
    pub points: Vec<RawPoint>,
    pub covariance: DMatrix<f64>,
}

/// A point as far as a file describes it.
pub(super) struct RawPoint {
    pub name: String,
    pub line: usize,
    pub place: [Option<f64>; 3],
    pub adjusted: [Option<AdjustedCoordinate>; 3],
}

/// The file and the line at which a covariance begins.
pub(super) struct Begins {
    pub path: PathBuf,
    pub line: usize,
}

impl Raw {
    /// The point of a name, which is new if there is none yet.
    pub fn point(&mut self, name: &str, line: usize) -> &mut RawPoint {
        let found = self.points.iter().position(|p| p.name == name);
        let at = found.unwrap_or_else(|| {
            self.points.push(RawPoint {
                name: name.to_owned(),
                line,
                place: [None; 3],
                adjusted: [None; 3],
            });
            self.points.len() - 1
        });
        &mut self.points[at]
    }

    pub fn checked(self, path: &Path, begins: &Begins) -> Result<Network, NetworkError> {
        let is_adjusted = |p: &RawPoint| p.adjusted.iter().any(Option::is_some);
        let Some(first) = self.points.iter().find(|p| is_adjusted(p)) else {
            return Err(error(path, 1, "no point is adjusted: leave one free".to_owned()));
        };
        let (name, line) = (first.name.clone(), first.line);
        check_covariance(&self.covariance).map_err(|message| error(&begins.path, begins.line, message))?;
        let placed = |p: RawPoint| {
            let [x, y, z] = p.place;
            Some(NetworkPoint {
                place: Point3::new(x?, y?, z?),
                name: p.name,
                adjusted: p.adjusted,
            })
        };
        let points: Vec<NetworkPoint> = { self.points.into_iter() }
            .filter(is_adjusted)
            .filter_map(placed)
            .collect();
        if points.is_empty() {
            let message = format!(
                "{name}, like every adjusted point, lacks x, y or z: write the network as .csv, which places its points"
            );
            return Err(error(path, line, message));
        }
        let mut files = vec![path.to_path_buf()];
        files.extend((begins.path != path).then(|| begins.path.clone()));
        Ok(Network {
            files,
            points,
            covariance: self.covariance,
        })
    }
}

/// What is wrong with a covariance; that of a free network has eigenvalues that are 0.
fn check_covariance(covariance: &DMatrix<f64>) -> Result<(), String> {
    if (covariance - covariance.transpose()).amax() > ROUNDING * covariance.amax() {
        return Err("the covariance is not symmetric: write it again, unchanged".to_owned());
    }
    let eigenvalues = covariance.symmetric_eigenvalues();
    let least = eigenvalues.min();
    if least < -ROUNDING * eigenvalues.max() {
        return Err(format!(
            "the covariance is not positive: its smallest eigenvalue is {least:.2e} m^2; write it again, unchanged and with \
             all its digits"
        ));
    }
    Ok(())
}

pub(super) fn error(path: &Path, line: usize, message: String) -> NetworkError {
    NetworkError {
        path: path.to_path_buf(),
        line,
        message,
    }
}

/// The text of a file.
pub(super) fn text_of(path: &Path) -> Result<String, NetworkError> {
    read_text(path).map_err(|e| error(path, 1, format!("cannot be read: {e}")))
}

/// The text of the file beside another one that holds the covariance of its coordinates.
pub(super) fn covariance_text(path: &Path, of: &Path) -> Result<String, NetworkError> {
    text_of(path).map_err(|e| {
        let message = format!("{}; it must hold the covariance of {}", e.message, of.display());
        error(path, 1, message)
    })
}

/// A finite number, or what else a text is.
pub(super) fn number(text: &str) -> Result<f64, String> {
    let found = text.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    found.ok_or_else(|| format!("{text:?} is no number"))
}
