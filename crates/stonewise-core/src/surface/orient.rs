//! Which side of a surface is outside.

use super::SurfaceCell;
use super::spanning::consistent_groups;
use crate::cloud::GridIndex;
use nalgebra::Point3;

/// Cosine of the angle to the vertical below which a cell is a wall, and above which it is level.
const STEEP: f64 = 0.5;
const LEVEL: f64 = 0.85;
/// Skewness below which nothing is said: about twice its standard error for a cell of 150 points.
const LEAST_SKEWNESS: f64 = 0.3;
/// Rise of a normal below which a wall counts as plumb.
const LEAST_BATTER: f64 = 0.05;
/// Evidence from which on the outside is known: standard deviations of the sum.
const SURE: f64 = 2.5;
/// Height above the lowest surfaces up to which level ones are seen from above, metres: eyes and scanners on
/// tripods are higher. Above, soffits are seen from below.
const EYE_M: f64 = 1.5;
/// Part of the cells that count as independent where neighbours share what the surface looks like.
const INDEPENDENT: f64 = 0.1;

/// What speaks for the outside that was chosen, in standard deviations; negative speaks against it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evidence {
    /// Scanners stand outside.
    pub scanners: f64,
    /// Low level surfaces (ground, ledges, treads) are seen from above.
    pub level: f64,
    /// Joints lie behind the faces of stones.
    pub joints: f64,
    /// Walls lean back.
    pub batter: f64,
}

impl Evidence {
    /// All together, in standard deviations.
    pub fn total(&self) -> f64 {
        // Where scanners stood is known, the rest is circumstantial.
        if self.scanners == 0.0 {
            (self.level + self.joints + self.batter) / 3f64.sqrt()
        } else {
            self.scanners
        }
    }

    fn reversed(self) -> Self {
        Self {
            scanners: -self.scanners,
            level: -self.level,
            joints: -self.joints,
            batter: -self.batter,
        }
    }
}

/// Surface cells whose normals point outside.
#[derive(Clone, Debug)]
pub struct Orientation {
    /// The cells.
    pub cells: Vec<SurfaceCell>,
    /// What decided about the largest connected surface.
    pub evidence: Evidence,
}

impl Orientation {
    /// Whether the outside is beyond doubt.
    pub fn is_sure(&self) -> bool {
        self.evidence.total() >= SURE
    }
}

/// Turns the normals of all cells outside; `scanners`: positions from which the surface was measured, world
/// frame, none where they are not known.
///
/// Cells that touch each other get consistent signs first. Then each connected surface is turned to the side
/// that the evidence favours; a small one whose own evidence is weak follows the nearest cell of the largest.
///
/// Cost: 13 neighbours a cell, sorted.
pub fn orient(mut cells: Vec<SurfaceCell>, scanners: &[Point3<f64>]) -> Orientation {
    let groups = consistent_groups(&mut cells);
    let mut decided = Evidence::default();
    let Some((largest, others)) = groups.split_first() else {
        return Orientation {
            cells,
            evidence: decided,
        };
    };
    let found = evidence_of(&cells, largest, scanners);
    decided = turn(&mut cells, largest, found, found.total() < 0.0);
    let centroids: Vec<Point3<f64>> = largest.iter().map(|&i| cells[i].centroid).collect();
    let index = GridIndex::for_nearest(&centroids);
    for group in others {
        let found = evidence_of(&cells, group, scanners);
        let is_inward = match found.total().abs() >= SURE {
            true => found.total() < 0.0,
            false => opposes(&cells, group, largest, &index),
        };
        turn(&mut cells, group, found, is_inward);
    }
    Orientation {
        cells,
        evidence: decided,
    }
}

/// Turns all cells of a group round where their normals point inward; the evidence after that.
fn turn(cells: &mut [SurfaceCell], group: &[usize], found: Evidence, is_inward: bool) -> Evidence {
    if !is_inward {
        return found;
    }
    for &i in group {
        cells[i] = cells[i].flipped();
    }
    found.reversed()
}

/// Whether most normals of a group oppose those of the nearest cells of the largest group; `index`: of its
/// centroids.
fn opposes(cells: &[SurfaceCell], group: &[usize], largest: &[usize], index: &GridIndex) -> bool {
    // A few cells of the group say what all would.
    let step = group.len().div_ceil(50);
    let cosines = group.iter().step_by(step).filter_map(|&i| {
        let (nearest, _) = index.nearest(&cells[i].centroid, f64::INFINITY)?;
        Some(cells[i].normal.dot(&cells[largest[nearest]].normal))
    });
    cosines.sum::<f64>() < 0.0
}

fn evidence_of(cells: &[SurfaceCell], group: &[usize], scanners: &[Point3<f64>]) -> Evidence {
    let all = || group.iter().map(|&i| &cells[i]);
    let walls = || all().filter(|c| c.normal.z.abs() < STEEP);
    let facing = |c: &SurfaceCell| {
        let to = scanners.iter().map(|s| s - c.centroid);
        let nearest = to.min_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()));
        nearest.map_or(0.0, |to| c.normal.dot(&to))
    };
    let lowest_m = low_end(all().map(|c| c.centroid.z).collect());
    Evidence {
        scanners: sign_test(all().map(facing), 1.0),
        level: sign_test(
            all()
                .filter(|c| c.centroid.z < lowest_m + EYE_M)
                .map(|c| c.normal.z)
                .filter(|z| z.abs() > LEVEL),
            INDEPENDENT,
        ),
        joints: sign_test(
            walls().map(|c| -c.skewness).filter(|s| s.abs() > LEAST_SKEWNESS),
            INDEPENDENT,
        ),
        batter: sign_test(
            walls().map(|c| c.normal.z).filter(|z| z.abs() > LEAST_BATTER),
            INDEPENDENT,
        ),
    }
}

/// The fiftieth part from below: stray points lie lower than anything.
fn low_end(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 50).copied().unwrap_or(0.0)
}

/// How many more values are positive than negative, in standard deviations of that difference for signs at
/// random, of which a part is independent.
fn sign_test(values: impl Iterator<Item = f64>, independent: f64) -> f64 {
    let (mut positive, mut negative) = (0.0, 0.0);
    for value in values {
        if value > 0.0 {
            positive += 1.0;
        } else if value < 0.0 {
            negative += 1.0;
        }
    }
    let count: f64 = positive + negative;
    if count == 0.0 {
        return 0.0;
    }
    (positive - negative) * (independent / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, MemoryTiles};
    use crate::progress::Silent;
    use crate::surface::surface_cells;
    use nalgebra::{Rotation3, Vector3};

    /// A wall of 6 x 3 m in the plane y = 0 that faces -y, with joints 2 cm deep and 4 cm wide every 50 cm,
    /// which may lean back.
    fn masonry(lean: f64) -> Vec<Point3<f64>> {
        let joint = |v: f64| v.rem_euclid(0.5) < 0.04;
        (0..300)
            .flat_map(|i| (0..150).map(move |j| (0.02 * f64::from(i) + 0.007, 0.02 * f64::from(j) + 0.003)))
            .map(|(x, z)| {
                let depth = if joint(x) || joint(z) {
                    0.02
                } else {
                    0.002 * (9.0 * x + 5.0 * z).sin()
                };
                Point3::new(x, depth + lean * z, z)
            })
            .collect()
    }

    fn ground() -> Vec<Point3<f64>> {
        (0..300)
            .flat_map(|i| (0..100).map(move |j| (0.02 * f64::from(i), -0.02 * f64::from(j))))
            .map(|(x, y)| Point3::new(x, y - 0.01, 0.005 * (40.0 * x).sin() * (31.0 * y).cos()))
            .collect()
    }

    fn oriented(points: Vec<Point3<f64>>, scanners: &[Point3<f64>]) -> Orientation {
        let tiles = MemoryTiles::new([Cloud::from_world(Point3::origin(), points)]);
        let cells = surface_cells::<_, Box<dyn std::error::Error + Send + Sync>>(&tiles, 0.5, &Silent);
        orient(cells.unwrap(), scanners)
    }

    #[test]
    fn joints_and_batter_show_the_outside_of_a_wall_alone() {
        for lean in [0.0, 0.2] {
            let found = oriented(masonry(lean), &[]);
            assert!(
                found.cells.len() > 60 && found.cells.iter().all(|c| c.normal.y < -0.9),
                "{lean}"
            );
            assert!(found.evidence.joints > 1.0, "{:?}", found.evidence);
            assert_eq!(found.evidence.batter > 1.0, lean > 0.0);
        }
    }

    #[test]
    fn the_ground_lies_before_a_wall() {
        // A wall without joints says nothing itself.
        let plain = masonry(0.0).into_iter().map(|p| Point3::new(p.x, 0.0, p.z));
        let found = oriented(plain.chain(ground()).collect(), &[]);
        assert!(found.evidence.level > 2.0);
        for cell in &found.cells {
            let outside = if cell.centroid.z > 0.3 {
                -Vector3::y()
            } else {
                Vector3::z()
            };
            assert!(
                cell.centroid.z < 0.3 && cell.centroid.y > -0.5 || cell.normal.dot(&outside) > 0.9,
                "{cell:?}"
            );
        }
    }

    #[test]
    fn scanners_overrule_what_the_surface_looks_like() {
        let behind = [Point3::new(3.0, 8.0, 1.5)];
        let found = oriented(masonry(0.2), &behind);
        assert!(found.is_sure() && found.cells.iter().all(|c| c.normal.y > 0.9));
    }

    /// A closed round tower, its cells with signs at random, seen from the middle: all normals point inward,
    /// wherever the axes of the world lie.
    #[test]
    fn signs_are_consistent_around_a_tower() {
        let turn = Rotation3::from_euler_angles(0.3, -0.4, 1.1);
        let points =
            (0..800).flat_map(|i| (0..100).map(move |j| (0.00785 * f64::from(i), 0.02 * f64::from(j))));
        let points: Vec<_> = points
            .map(|(angle, z)| turn * Point3::new(3.0 * angle.cos(), 3.0 * angle.sin(), z))
            .collect();
        let found = oriented(points, &[turn * Point3::new(0.0, 0.0, 1.0)]);
        assert!(found.cells.len() > 100);
        for cell in &found.cells {
            let local = turn.inverse() * cell.centroid;
            let inward = turn * -Vector3::new(local.x, local.y, 0.0).normalize();
            assert!(cell.normal.dot(&inward) > 0.9, "{cell:?}");
        }
    }
}
