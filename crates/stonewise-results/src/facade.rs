//! The wall, unrolled: from world coordinates to metres along the wall and up its face.

use nalgebra::{Point2, Point3, Rotation3, Vector3};
use serde::{Deserialize, Serialize};
use stonewise_core::geometry::FaceFrame;

/// Number of stretches along the wall whose direction is averaged at most.
const MAX_STRETCHES: usize = 60;
/// A stretch has at least this many stones, so that the relief of single stones does not bend the wall.
const MIN_STONES_PER_STRETCH: usize = 12;
/// Largest turn of the wall to either side of its middle that unrolls without folds, radians (80 degrees).
const MAX_TURN_RAD: f64 = 1.396;

/// Unrolls a straight or curved wall that is seen from one side.
///
/// `along` is the arc length of the wall's horizontal line, from its left end for a viewer in front; `up` is
/// the length along the batter, from the lowest stone. The direction of the wall is the mean of its stones'
/// normals in stretches of the chord; the arc length integrates 1 / cos(turn against the mean normal).
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(try_from = "FacadeFile", into = "FacadeFile")]
pub struct Facade {
    origin: Point3<f64>,
    /// Upright frame across the mean normal; its `along` is the chord.
    frame: FaceFrame,
    /// Ascending along the chord; never empty.
    stretches: Vec<Stretch>,
    up_per_height: f64,
    start: Point2<f64>,
}

/// Least length up the face for a metre of height: 1 for an upright wall, less rounding.
const LEAST_RISE: f64 = 0.999;

/// A facade in files.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FacadeFile {
    /// World, metres; every distance counts from here.
    origin: [f64; 3],
    /// Mean normal of the wall, level, world.
    out: [f64; 3],
    /// Length up the face for a metre of height.
    up_per_height: f64,
    /// (along, up) of the left end and the lowest stone before they became zero, metres.
    start: [f64; 2],
    /// Place on the chord and arc length, metres, and turn of the wall, radians, ascending.
    stretches: Vec<[f64; 3]>,
}

impl From<Facade> for FacadeFile {
    fn from(facade: Facade) -> Self {
        let stretch = |s: &Stretch| [s.chord_m, s.arc_m, s.turn_rad];
        Self {
            origin: facade.origin.into(),
            out: facade.frame.out.into(),
            up_per_height: facade.up_per_height,
            start: facade.start.into(),
            stretches: facade.stretches.iter().map(stretch).collect(),
        }
    }
}

impl TryFrom<FacadeFile> for Facade {
    type Error = String;

    fn try_from(file: FacadeFile) -> Result<Self, String> {
        let stretch = |[chord_m, arc_m, turn_rad]: [f64; 3]| Stretch {
            chord_m,
            arc_m,
            turn_rad,
        };
        let stretches: Vec<Stretch> = file.stretches.into_iter().map(stretch).collect();
        let ascends = stretches.windows(2).all(|w| w[0].chord_m <= w[1].chord_m);
        let turns = stretches.iter().all(|s| s.turn_rad.abs() <= MAX_TURN_RAD);
        if stretches.is_empty() || !ascends || !turns || file.up_per_height < LEAST_RISE {
            return Err("this is no unrolled wall: copy it from the file that stonewise wrote".to_owned());
        }
        Ok(Self {
            origin: file.origin.into(),
            frame: FaceFrame::from_normal(&file.out.into()),
            stretches,
            up_per_height: file.up_per_height,
            start: file.start.into(),
        })
    }
}

#[derive(Clone, Copy, Debug)]
struct Stretch {
    chord_m: f64,
    arc_m: f64,
    /// Horizontal turn of the wall's normal against the mean normal, positive to the right.
    turn_rad: f64,
}

impl Facade {
    /// The facade of stones with these centroids and outward normals; any number, none included.
    ///
    /// Stones at places that are not finite are left out.
    pub fn new(stones: &[(Point3<f64>, Vector3<f64>)]) -> Self {
        let finite = |s: &&(Point3<f64>, Vector3<f64>)| s.0.iter().chain(s.1.iter()).all(|v| v.is_finite());
        let stones: &[_] = &stones.iter().filter(finite).copied().collect::<Vec<_>>();
        let origin = stones.first().map_or(Point3::origin(), |s| s.0);
        let mean: Vector3<f64> = stones.iter().map(|s| s.1).sum();
        let level = Vector3::new(mean.x, mean.y, 0.0);
        let frame = FaceFrame::from_normal(&if level.norm() > 1e-9 { level } else { Vector3::x() });
        let rise: f64 = stones.iter().map(|s| FaceFrame::from_normal(&s.1).up.z).sum();
        let mut facade = Self {
            origin,
            frame,
            stretches: stretches(stones, &origin, &frame),
            up_per_height: if rise > 0.0 {
                stones.len() as f64 / rise
            } else {
                1.0
            },
            start: Point2::origin(),
        };
        facade.start = stones
            .iter()
            .map(|s| facade.place(&s.0))
            .reduce(|a, b| a.inf(&b))
            .unwrap_or_default();
        facade
    }

    /// (along, up) of a point of the wall, metres.
    pub fn place(&self, p: &Point3<f64>) -> Point2<f64> {
        let up = (p.z - self.origin.z) * self.up_per_height;
        Point2::new(
            self.at_chord(self.chord(p)).arc_m - self.start.x,
            up - self.start.y,
        )
    }

    /// (along, up) of a point of a stone, which keeps its true shape.
    pub fn place_in_stone(
        &self,
        p: &Point3<f64>,
        centroid: &Point3<f64>,
        normal: &Vector3<f64>,
    ) -> Point2<f64> {
        let frame = FaceFrame::from_normal(normal);
        let centre = self.place(centroid);
        Point2::new(
            centre.x + (p - centroid).dot(&frame.along),
            centre.y + (p - centroid).dot(&frame.up),
        )
    }

    /// Face frame of the wall around this place, without the relief of single stones.
    pub fn frame_at(&self, p: &Point3<f64>) -> FaceFrame {
        let turn = self.at_chord(self.chord(p)).turn_rad;
        let level = Rotation3::new(Vector3::z() * turn) * self.frame.out;
        // up_per_height = 1 / cos(lean).
        let lean = (1.0 / self.up_per_height).clamp(-1.0, 1.0).acos();
        FaceFrame::from_normal(&(level * lean.cos() + Vector3::z() * lean.sin()))
    }

    /// Distance in front of the upright plane through the wall's middle, metres.
    pub fn out_m(&self, p: &Point3<f64>) -> f64 {
        (p - self.origin).dot(&self.frame.out)
    }

    fn chord(&self, p: &Point3<f64>) -> f64 {
        (p - self.origin).dot(&self.frame.along)
    }

    /// Arc length and turn at a place of the chord, linear between stretches, straight on beyond the ends.
    fn at_chord(&self, chord_m: f64) -> Stretch {
        let after = self.stretches.partition_point(|s| s.chord_m < chord_m);
        let b = self.stretches[after.min(self.stretches.len() - 1)];
        let a = self.stretches[after.saturating_sub(1)];
        if a.chord_m < chord_m && chord_m < b.chord_m {
            let t = (chord_m - a.chord_m) / (b.chord_m - a.chord_m);
            let mix = |p: f64, q: f64| p + t * (q - p);
            return Stretch {
                chord_m,
                arc_m: mix(a.arc_m, b.arc_m),
                turn_rad: mix(a.turn_rad, b.turn_rad),
            };
        }
        let end = if chord_m <= a.chord_m { a } else { b };
        Stretch {
            chord_m,
            arc_m: end.arc_m + (chord_m - end.chord_m) / end.turn_rad.cos(),
            turn_rad: end.turn_rad,
        }
    }
}

fn stretches(
    stones: &[(Point3<f64>, Vector3<f64>)],
    origin: &Point3<f64>,
    frame: &FaceFrame,
) -> Vec<Stretch> {
    let mut along: Vec<(f64, Vector3<f64>)> = stones
        .iter()
        .map(|(c, n)| ((c - origin).dot(&frame.along), *n))
        .collect();
    along.sort_by(|a, b| a.0.total_cmp(&b.0));
    let count = (along.len() / MIN_STONES_PER_STRETCH).clamp(1, MAX_STRETCHES);
    let mut all: Vec<Stretch> = Vec::with_capacity(count);

    for i in 0..count {
        let part = &along[i * along.len() / count..(i + 1) * along.len() / count];
        let chord_m = part.iter().map(|p| p.0).sum::<f64>() / part.len().max(1) as f64;
        let normal: Vector3<f64> = part.iter().map(|p| p.1).sum();
        let turn = if count == 1 {
            0.0
        } else {
            normal.dot(&frame.along).atan2(normal.dot(&frame.out))
        };
        let turn_rad = turn.clamp(-MAX_TURN_RAD, MAX_TURN_RAD);
        let arc_m = all.last().map_or(0.0, |s| {
            s.arc_m + (chord_m - s.chord_m) * (1.0 / turn_rad.cos() + 1.0 / s.turn_rad.cos()) / 2.0
        });
        all.push(Stretch {
            chord_m,
            arc_m,
            turn_rad,
        });
    }

    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_battered_wall_far_away_keeps_its_distances() {
        let frame = FaceFrame::from_normal(&Vector3::new(-0.7, 0.7, 0.2));
        let corner = Point3::new(4.5e5, 5.6e6, 300.0);
        let stones: Vec<_> = (0..400)
            .map(|i| {
                let (a, u) = (f64::from(i % 40) * 0.3, f64::from(i / 40) * 0.2);
                (corner + frame.along * a + frame.up * u, frame.out)
            })
            .collect();
        let facade = Facade::new(&stones);
        for (i, (p, n)) in stones.iter().enumerate() {
            let place = facade.place(p);
            let expected = Point2::new((i % 40) as f64 * 0.3, (i / 40) as f64 * 0.2);
            assert!((place - expected).norm() < 1e-3, "{place} {expected}");
            assert!((facade.place_in_stone(p, p, n) - place).norm() < 1e-12);
        }
        assert!((facade.frame_at(&corner).out - frame.out).norm() < 1e-6);
    }

    #[test]
    fn an_arch_unrolls_to_its_arc_length_left_to_right() {
        // Radius 50 m, 100 degrees, seen from outside.
        let radius = 50.0;
        let normal = |angle: f64| Vector3::new(angle.cos(), angle.sin(), 0.0);
        let stones: Vec<_> = (0..3000)
            .map(|i| {
                let angle = (f64::from(i / 10) / 299.0 - 0.5) * 100f64.to_radians();
                (
                    Point3::from(normal(angle) * radius) + Vector3::z() * f64::from(i % 10),
                    normal(angle),
                )
            })
            .collect();
        let facade = Facade::new(&stones);
        for (p, n) in &stones {
            let angle = n.y.atan2(n.x) + 50f64.to_radians();
            assert!(
                (facade.place(p).x - radius * angle).abs() < 0.15,
                "{} {}",
                facade.place(p).x,
                radius * angle
            );
            assert!((facade.place(p).y - p.z).abs() < 1e-9);
            assert!(facade.frame_at(p).out.dot(n) > 0.999);
        }
    }

    #[test]
    fn a_facade_comes_back_from_its_file_and_nonsense_is_refused() {
        let normal = |angle: f64| Vector3::new(angle.cos(), angle.sin(), 0.2);
        let stones: Vec<_> = (0..500)
            .map(|i| {
                (
                    Point3::from(normal(f64::from(i) * 0.002) * 30.0),
                    normal(f64::from(i) * 0.002),
                )
            })
            .collect();
        let facade = Facade::new(&stones);
        let text = serde_json::to_string(&facade).unwrap();
        let back: Facade = serde_json::from_str(&text).unwrap();
        for (p, _) in &stones {
            assert!((back.place(p) - facade.place(p)).norm() < 1e-9);
            assert!((back.out_m(p) - facade.out_m(p)).abs() < 1e-9);
        }
        let empty = text.replace(text.split_once("\"stretches\":").unwrap().1, "[]}");
        assert!(serde_json::from_str::<Facade>(&empty).is_err());
    }

    #[test]
    fn no_stones_and_one_stone_have_a_facade() {
        assert_eq!(Facade::new(&[]).place(&Point3::origin()), Point2::origin());
        let one = Facade::new(&[(Point3::new(5.0, 5.0, 5.0), Vector3::y())]);
        assert!(one.place(&Point3::new(5.0, 5.0, 5.0)).coords.norm() < 1e-12);
        assert!(one.place(&Point3::new(4.0, 5.0, 5.0)).x > 0.9);
    }
}
