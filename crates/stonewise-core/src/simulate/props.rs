//! What stands around the wall and does not move: ground, banks, crown, an annex, railings, shrubs.

use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// What a ray can meet besides stones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Material {
    /// The joints.
    Mortar,
    /// Grass and soil.
    Ground,
    /// Overgrown slopes beside the section.
    Bank,
    /// The crown's concrete.
    Concrete,
    /// The annex's walls.
    Plaster,
    /// The annex's door.
    Door,
    /// The annex's roof.
    Roof,
    /// Railings.
    Metal,
    /// Leaves.
    Leaf,
}

/// A body with one material.
#[derive(Clone, Debug)]
pub struct Prop {
    /// Its material.
    pub material: Material,
    shape: Form,
}

#[derive(Clone, Debug)]
enum Form {
    Box {
        min: Point3<f64>,
        max: Point3<f64>,
    },
    Leaves {
        middle: Point3<f64>,
        radius_m: f64,
        discs: Vec<Disc>,
    },
}

#[derive(Clone, Debug)]
struct Disc {
    centre: Point3<f64>,
    normal: Vector3<f64>,
    radius_m: f64,
}

/// What stands in front of the wall.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SurroundingsParams {
    /// A small building at the foot that hides stones.
    pub annex: bool,
    /// A railing along the foot.
    pub railing: bool,
    /// Number of shrubs at the foot.
    pub shrubs: u32,
    /// Seed of the shrubs.
    pub seed: u64,
}

impl Default for SurroundingsParams {
    fn default() -> Self {
        Self {
            annex: true,
            railing: true,
            shrubs: 2,
            seed: 1,
        }
    }
}

impl Prop {
    fn block(material: Material, min: [f64; 3], max: [f64; 3]) -> Self {
        Self {
            material,
            shape: Form::Box {
                min: Point3::from(min),
                max: Point3::from(max),
            },
        }
    }

    /// Distance along the ray to the first hit within `limit`, and the outward normal there.
    pub fn trace(&self, from: &Point3<f64>, along: &Vector3<f64>, limit: f64) -> Option<(f64, Vector3<f64>)> {
        match &self.shape {
            Form::Box { min, max } => trace_box(from, along, min, max, limit),
            Form::Leaves {
                middle,
                radius_m,
                discs,
            } => {
                let to = middle - from;
                let t = to.dot(along);
                if (to - along * t).norm_squared() > radius_m * radius_m || t - radius_m > limit {
                    return None;
                }
                discs
                    .iter()
                    .filter_map(|d| trace_disc(from, along, d, limit))
                    .min_by(|p, q| p.0.total_cmp(&q.0))
            }
        }
    }

    /// Whether the point lies inside the body, leaves apart.
    pub fn contains(&self, p: &Point3<f64>) -> bool {
        match &self.shape {
            Form::Box { min, max } => (0..3).all(|i| min[i] < p[i] && p[i] < max[i]),
            Form::Leaves { .. } => false,
        }
    }
}

/// The surroundings of a section `width_m` x `height_m` (measured in the face) with this batter; ground is z = 0.
pub fn surroundings(width_m: f64, height_m: f64, batter: f64, params: &SurroundingsParams) -> Vec<Prop> {
    use Material::{Bank, Concrete, Door, Ground, Metal, Plaster, Roof};
    let half = width_m / 2.0;
    let top = height_m / batter.hypot(1.0);
    let back = -batter * top;
    let mut props = vec![
        Prop::block(Ground, [-60.0, -90.0, -2.0], [60.0, 90.0, 0.0]),
        Prop::block(
            Concrete,
            [back - 3.0, -half, -0.5],
            [back - 0.12, half, top - 0.03],
        ),
        Prop::block(Bank, [-40.0, half, -0.5], [0.02, half + 60.0, top + 0.15]),
        Prop::block(Bank, [-40.0, -half - 60.0, -0.5], [0.02, -half, top + 0.05]),
    ];
    if params.annex {
        let (y, w, h) = (0.12 * width_m, 0.17 * width_m.min(14.0), 0.36 * height_m.min(8.0));
        props.push(Prop::block(Plaster, [0.35, y, 0.0], [0.35 + 0.8 * w, y + w, h]));
        props.push(Prop::block(
            Door,
            [0.35 + 0.8 * w, y + 0.3 * w, 0.0],
            [0.355 + 0.8 * w, y + 0.65 * w, 0.8 * h],
        ));
        props.push(Prop::block(
            Roof,
            [0.28, y - 0.07, h],
            [0.42 + 0.8 * w, y + w + 0.07, h + 0.08],
        ));
    }
    if params.railing {
        let (from, to, x) = (-0.92 * half, -0.25 * half, 0.75);
        let h = 0.9f64.min(0.4 * height_m);
        let posts = ((to - from) / 1.4).ceil().max(1.0);
        for k in 0..=posts as usize {
            let y = from + (to - from) * k as f64 / posts;
            props.push(Prop::block(
                Metal,
                [x - 0.02, y - 0.02, 0.0],
                [x + 0.02, y + 0.02, h],
            ));
        }
        for z in [0.5 * h, h] {
            props.push(Prop::block(
                Metal,
                [x - 0.018, from, z - 0.018],
                [x + 0.018, to, z + 0.018],
            ));
        }
    }
    let mut rng = ChaCha8Rng::seed_from_u64(params.seed);
    for k in 0..params.shrubs {
        let share = (f64::from(k) + rng.random_range(0.25..0.75)) / f64::from(params.shrubs);
        props.push(shrub(
            [0.3, -half + width_m * share],
            0.09 * height_m.min(5.0),
            &mut rng,
        ));
    }
    props
}

fn shrub(foot: [f64; 2], radius_m: f64, rng: &mut ChaCha8Rng) -> Prop {
    let middle = Point3::new(foot[0], foot[1], 0.75 * radius_m);
    let mut unit = || -> Vector3<f64> {
        Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0))
            .try_normalize(1e-3)
            .unwrap_or_else(Vector3::z)
    };
    let discs = (0..170)
        .map(|k| {
            // More leaves outside than inside, and none under ground.
            let spread = radius_m * (0.35 + 0.6 * (f64::from(k) / 170.0).sqrt());
            let mut centre = middle + unit() * spread;
            centre.z = centre.z.abs().max(0.01);
            Disc {
                centre,
                normal: unit(),
                radius_m: 0.09 * radius_m + 0.008,
            }
        })
        .collect();
    Prop {
        material: Material::Leaf,
        shape: Form::Leaves {
            middle,
            radius_m: 1.25 * radius_m,
            discs,
        },
    }
}

fn trace_box(
    from: &Point3<f64>,
    along: &Vector3<f64>,
    min: &Point3<f64>,
    max: &Point3<f64>,
    limit: f64,
) -> Option<(f64, Vector3<f64>)> {
    let (mut near, mut far, mut axis) = (f64::MIN, f64::MAX, 0);
    for i in 0..3 {
        let inverse = 1.0 / along[i];
        let (t0, t1) = ((min[i] - from[i]) * inverse, (max[i] - from[i]) * inverse);
        let (t0, t1) = if t0 < t1 { (t0, t1) } else { (t1, t0) };
        if t0 > near {
            (near, axis) = (t0, i);
        }
        far = far.min(t1);
    }
    if near > far || near <= 0.0 || near > limit {
        return None;
    }
    let mut normal = Vector3::zeros();
    normal[axis] = -along[axis].signum();
    Some((near, normal))
}

fn trace_disc(
    from: &Point3<f64>,
    along: &Vector3<f64>,
    disc: &Disc,
    limit: f64,
) -> Option<(f64, Vector3<f64>)> {
    let slope = disc.normal.dot(along);
    let t = disc.normal.dot(&(disc.centre - from)) / slope;
    if !(t > 0.0 && t <= limit) {
        return None;
    }
    let inside = (from + along * t - disc.centre).norm_squared() <= disc.radius_m * disc.radius_m;
    inside.then(|| (t, -disc.normal * slope.signum()))
}
