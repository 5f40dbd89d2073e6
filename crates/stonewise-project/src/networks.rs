//! Adjusted networks, one for each epoch, and the motions of their points.

use crate::instruments::{AxisMotion, ReadingGap};
use nalgebra::{DMatrix, Point3};
use std::path::{Path, PathBuf};
use stonewise_base::error::{Error, Result};
use stonewise_core::epoch::EpochId;
use stonewise_io::network::{AdjustedCoordinate, Network, NetworkPoint};

/// An adjusted network.
#[derive(Clone, Debug)]
pub struct NetworkFile {
    /// The epoch whose coordinates it has.
    pub epoch: EpochId,
    /// Whether the motions from the reference to this epoch are observations of its datum.
    pub is_used: bool,
    /// How far from a point stones are compared with it, metres.
    pub reach_m: f64,
    /// Its points.
    pub network: Network,
    /// The project file that names it, and the line.
    pub stated: (PathBuf, usize),
}

/// What the points of a network moved from the reference to a later epoch.
#[derive(Clone, Debug)]
pub struct NetworkMotion<'a> {
    /// The points of both epochs, then those that one of them lacks.
    pub points: Vec<PointMotion<'a>>,
    /// Covariance of the motions, m^2: of three axes for each point; 0 where nothing was measured.
    pub covariance: DMatrix<f64>,
}

/// What a point of a network moved.
#[derive(Clone, Debug)]
pub struct PointMotion<'a> {
    /// Its name.
    pub name: &'a str,
    /// Where it is.
    pub place: Point3<f64>,
    /// Its motion along x, y and z, `None` where it was not measured; or which epoch lacks it.
    pub motion: std::result::Result<[Option<AxisMotion>; 3], ReadingGap>,
}

impl NetworkFile {
    /// What the points moved since the reference, whose network is `first`. The two networks are independent, so that
    /// their covariances add up.
    pub fn motion_since<'a>(&'a self, first: &'a Self) -> NetworkMotion<'a> {
        let networks = [&first.network, &self.network];
        let both: Vec<[&NetworkPoint; 2]> = { networks[0].points.iter() }
            .filter_map(|p| Some([p, point(networks[1], &p.name)?]))
            .collect();
        // Of a point and an axis, the coordinate in both networks.
        let adjusted = |at: usize, axis: usize| -> Option<[AdjustedCoordinate; 2]> {
            let [first, later] = both[at].map(|p| p.adjusted[axis]);
            Some([first?, later?])
        };
        let covariance = DMatrix::from_fn(3 * both.len(), 3 * both.len(), |r, c| {
            let pair = adjusted(r / 3, r % 3).zip(adjusted(c / 3, c % 3));
            let of = |k: usize, (r, c): ([AdjustedCoordinate; 2], [AdjustedCoordinate; 2])| {
                networks[k].covariance[(r[k].row, c[k].row)]
            };
            pair.map_or(0.0, |pair| of(0, pair) + of(1, pair))
        });
        let moved = |at: usize| {
            [0, 1, 2].map(|axis| {
                let [first, later] = adjusted(at, axis)?;
                Some(AxisMotion {
                    value_m: later.value_m - first.value_m,
                    variance_m2: covariance[(3 * at + axis, 3 * at + axis)],
                })
            })
        };
        let mut points: Vec<PointMotion> = { both.iter().enumerate() }
            .map(|(at, [p, _])| PointMotion {
                name: &p.name,
                place: p.place,
                motion: Some(moved(at))
                    .filter(|m| m.iter().any(Option::is_some))
                    .ok_or(ReadingGap::After),
            })
            .collect();
        for (of, other, gap) in [(0, 1, ReadingGap::After), (1, 0, ReadingGap::Before)] {
            let alone = networks[of].points.iter();
            let alone = alone.filter(|p| point(networks[other], &p.name).is_none());
            points.extend(alone.map(|p| PointMotion {
                name: &p.name,
                place: p.place,
                motion: Err(gap),
            }));
        }
        NetworkMotion { points, covariance }
    }

    /// The file that it was read from.
    pub fn path(&self) -> &Path {
        self.network.files.first().map_or(&self.stated.0, |path| path)
    }

    /// An error about its table in the project file.
    pub fn error(&self, message: String) -> Error {
        let (path, line) = self.stated.clone();
        Error::Project { path, line, message }
    }
}

fn point<'a>(network: &'a Network, name: &str) -> Option<&'a NetworkPoint> {
    network.points.iter().find(|p| p.name == name)
}

/// Checks that the networks of a project can be compared; `names`: of the epochs.
///
/// # Errors
/// With the line of the table: two networks of one epoch, none of the reference, no point that is also in that of the
/// reference.
pub(crate) fn check_networks(networks: &[NetworkFile], names: &[&str]) -> Result<()> {
    let Some(any) = networks.first() else {
        return Ok(());
    };
    let Some(first) = networks.iter().find(|n| n.epoch.is_reference()) else {
        let name = names.first().copied().unwrap_or_default();
        return Err(any.error(format!(
            "motions count from the reference, and it has no network: add a table with `network` and `epoch = {name:?}`"
        )));
    };
    for (k, network) in networks.iter().enumerate() {
        let twin = networks[..k].iter().any(|n| n.epoch == network.epoch);
        let name = names.get(network.epoch.index()).copied().unwrap_or_default();
        if twin {
            return Err(network.error(format!("epoch {name} has a network already: leave one table")));
        }
        let is_shared = |p: &NetworkPoint| point(&first.network, &p.name).is_some();
        if !network.network.points.iter().any(is_shared) {
            return Err(network.error(format!(
                "{} has no point of {}: give points the same names in all epochs",
                network.path().display(),
                first.path().display()
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A network of points with all coordinates, but for one point without a height.
    fn network(names: &[&str], seed: u64, epoch: usize) -> NetworkFile {
        let mut draw = ChaCha8Rng::seed_from_u64(seed);
        let mut row = 0;
        let points = names.iter().map(|name| {
            let values = [0, 1, 2].map(|_| draw.random_range(0.0..10.0));
            let adjusted = [0, 1, 2].map(|axis| {
                (*name != "flat" || axis < 2).then(|| {
                    row += 1;
                    AdjustedCoordinate {
                        value_m: values[axis],
                        row: row - 1,
                    }
                })
            });
            NetworkPoint {
                name: (*name).to_owned(),
                place: values.into(),
                adjusted,
            }
        });
        let points: Vec<NetworkPoint> = points.collect();
        let root = DMatrix::from_fn(row, row, |_, _| draw.random_range(-1e-3..1e-3));
        NetworkFile {
            epoch: EpochId::at(epoch),
            is_used: false,
            reach_m: 2.0,
            network: Network {
                files: vec![PathBuf::from(format!("{epoch}.xml"))],
                points,
                covariance: &root * root.transpose(),
            },
            stated: (PathBuf::from("stonewise.toml"), 7 + epoch),
        }
    }

    /// The law of propagation, d = F x with cov(d) = F C F', by dense matrices of all coordinates of both networks.
    #[test]
    fn motions_and_their_covariance_are_those_of_the_law_of_propagation() {
        let first = network(&["a", "old", "flat", "b"], 1, 0);
        let later = network(&["b", "flat", "a", "new"], 2, 1);
        let found = later.motion_since(&first);
        let names: Vec<&str> = found.points.iter().map(|p| p.name).collect();
        assert_eq!(names, ["a", "flat", "b", "old", "new"]);
        assert_eq!(found.points[3].motion, Err(ReadingGap::After));
        assert_eq!(found.points[4].motion, Err(ReadingGap::Before));

        let count = [&first, &later].map(|n| n.network.covariance.nrows());
        let mut both = DMatrix::zeros(count[0] + count[1], count[0] + count[1]);
        both.view_mut((0, 0), (count[0], count[0]))
            .copy_from(&first.network.covariance);
        both.view_mut((count[0], count[0]), (count[1], count[1]))
            .copy_from(&later.network.covariance);
        // Rows of a (0..3), flat (6, 7) and b (8..11) at first; of b (0..3), flat (3, 4) and a (5..8) later.
        let rows = [[0, 5], [1, 6], [2, 7], [6, 3], [7, 4], [8, 0], [9, 1], [10, 2]];
        let mut difference = DMatrix::zeros(9, count[0] + count[1]);
        for (rows, motion) in rows.iter().zip([0, 1, 2, 3, 4, 6, 7, 8]) {
            difference[(motion, rows[0])] = -1.0;
            difference[(motion, count[0] + rows[1])] = 1.0;
        }
        let expected = &difference * both * difference.transpose();
        assert!((&found.covariance - &expected).amax() < 1e-18);
        for (point, [old, new]) in [(0, [0, 2]), (2, [3, 0])] {
            let expected = later.network.points[new].place - first.network.points[old].place;
            let motion = found.points[point].motion.unwrap();
            for axis in 0..3 {
                assert!((motion[axis].unwrap().value_m - expected[axis]).abs() < 1e-12);
                let variance = found.covariance[(3 * point + axis, 3 * point + axis)];
                assert_eq!(motion[axis].unwrap().variance_m2, variance);
            }
        }
        assert_eq!(found.points[1].motion.unwrap()[2], None);
    }

    #[test]
    fn networks_that_cannot_be_compared_are_refused_with_their_line() {
        let check = |networks: &[NetworkFile]| check_networks(networks, &["2025", "2026"]);
        let of = |names: &[&str], epoch| network(names, 3, epoch);
        assert!(check(&[]).is_ok() && check(&[of(&["a"], 1), of(&["a"], 0)]).is_ok());
        for (networks, message) in [
            (
                vec![of(&["a"], 1)],
                "stonewise.toml:8: motions count from the reference, and it has no network",
            ),
            (
                vec![of(&["a"], 0), of(&["a"], 1), of(&["b"], 1)],
                "stonewise.toml:8: epoch 2026 has a network already",
            ),
            (
                vec![of(&["a"], 0), of(&["b"], 1)],
                "stonewise.toml:8: 1.xml has no point of 0.xml",
            ),
        ] {
            let found = check(&networks).unwrap_err().to_string();
            assert!(found.contains(message), "{found}");
        }
    }
}
