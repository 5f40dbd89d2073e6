//! What time leaves on a wall: stains, runs, moss, lichen, soot, damp.

use super::canvas::Canvas;
use super::draw::{Rng, between, chance, log_between, mix, normal, scaled, smoothstep, sometimes};
use super::noise::{Field, Grain};
use stonewise_core::raster::linear_from_srgb;

/// Cover above which a place does not show the stone any more.
const HIDDEN: f32 = 0.6;
/// Share of a stone under cover above which its outline is doubtful.
const MAX_HIDDEN_SHARE: f32 = 0.65;

/// What lies on the surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dirt {
    /// Strength of large blotches, dark or bright, 0 to 0.5.
    pub stains: f32,
    /// Size of the blotches, 40 to 400 pixels.
    pub stains_px: f32,
    /// Strength of runs down the wall, 0 to 0.6.
    pub runs: f32,
    /// Width over which a run sets in, 0.1 (a sharp line) to 1.4, in deviations of the noise.
    pub runs_softness: f32,
    /// Share of the wall under moss, 0 to about 0.6.
    pub moss: f32,
    /// Share of the wall under lichen, 0 to about 0.4.
    pub lichen: f32,
    /// Size of the lichen's spots, 5 to 30 pixels.
    pub lichen_px: f32,
    /// Strength of soot or damp that grows towards one side, 0 to 0.7.
    pub soot: f32,
    /// Number of small holes and rusty nails, 0 to 12.
    pub marks: u32,
    /// Strength of white salt blooms, 0 to 0.6.
    pub salt: f32,
    /// Direction in the photo in which water runs, radians; down is pi/2.
    pub down: f32,
}

impl Dirt {
    /// Dirt drawn at random, for water that runs in the direction `down`; half of the walls are nearly clean.
    pub(super) fn random(rng: &mut Rng, down: f32) -> Self {
        let often = if chance(rng, 0.5) { 0.5 } else { 0.12 };
        Self {
            stains: sometimes(rng, 2.0 * often, 0.05, 0.5),
            stains_px: log_between(rng, 40.0, 400.0),
            runs: sometimes(rng, often, 0.1, 0.6),
            runs_softness: log_between(rng, 0.1, 1.4),
            moss: sometimes(rng, 0.6 * often, 0.05, 0.6),
            lichen: sometimes(rng, 0.6 * often, 0.05, 0.4),
            lichen_px: log_between(rng, 5.0, 30.0),
            soot: sometimes(rng, 0.6 * often, 0.1, 0.7),
            marks: sometimes(rng, often, 1.0, 13.0) as u32,
            salt: sometimes(rng, 0.5 * often, 0.1, 0.6),
            down,
        }
    }

    /// Dirties everything but the sky; stones that moss or lichen hide become doubtful.
    pub(super) fn paint(&self, canvas: &mut Canvas, rng: &mut Rng) {
        let coat = Coat::new(self, canvas.photo_size(), rng);
        let mut covered = vec![Covered::default(); canvas.stones as usize + 1];
        for y in 0..canvas.height {
            for x in 0..canvas.width {
                let i = y * canvas.width + x;
                if canvas.sky[i] {
                    continue;
                }
                let place = canvas.photo(x, y);
                let mut colour = coat.stained(canvas.albedo[i], place);
                let mut cover = 0.0f32;
                if self.lichen > 0.0 {
                    let amount = coat.lichen(place);
                    colour = mix(colour, coat.crust, 0.85 * amount);
                    cover = cover.max(0.8 * amount);
                }
                if self.moss > 0.0 {
                    let is_joint = canvas.label[i] == 0;
                    let (amount, tuft) = coat.moss(place, canvas.openness[i], is_joint);
                    colour = mix(colour, scaled(coat.green, (0.35 * tuft).exp()), 0.92 * amount);
                    canvas.relief[i] += amount * (0.8 + 0.5 * tuft);
                    cover = cover.max(amount);
                }
                canvas.albedo[i] = colour.map(|c| c.clamp(0.003, 1.0));
                let count = &mut covered[canvas.label[i] as usize];
                count.all += 1;
                count.hidden += u32::from(cover > HIDDEN);
            }
        }

        for _ in 0..self.marks {
            self.mark(canvas, rng);
        }

        for (label, doubtful) in canvas.label.iter_mut().zip(&mut canvas.doubtful) {
            let Covered { all, hidden } = covered[*label as usize];
            if *label != 0 && hidden as f32 > MAX_HIDDEN_SHARE * all as f32 {
                *label = 0;
                *doubtful = true;
            }
        }
    }
}

/// Samples of the canvas that belong to a stone.
#[derive(Clone, Copy, Default)]
struct Covered {
    all: u32,
    /// Samples under moss or lichen.
    hidden: u32,
}

/// Dirt with what is drawn once for a photo.
struct Coat<'a> {
    dirt: &'a Dirt,
    /// Width and height of the photo, pixels.
    size: [f32; 2],
    blotches: Field,
    streaks: Field,
    clumps: Field,
    tufts: Field,
    spots: Field,
    bloom: Field,
    green: [f32; 3],
    crust: [f32; 3],
    stain: [f32; 3],
    /// Whether stains are brighter than the stones.
    bright: bool,
    /// Direction from which soot comes, radians.
    side: f32,
    /// How much moss prefers joints.
    joints: f32,
}

impl<'a> Coat<'a> {
    fn new(dirt: &'a Dirt, size: [f32; 2], rng: &mut Rng) -> Self {
        let blotches = Field::isotropic(rng, Grain::Fractal, dirt.stains_px);
        let streak_px = log_between(rng, 8.0, 50.0);
        Self {
            dirt,
            size,
            blotches,
            streaks: Field::new(rng, Grain::Fractal, [18.0 * streak_px, streak_px], dirt.down),
            clumps: Field::sized(rng, Grain::Fractal, 40.0, 250.0),
            tufts: Field::isotropic(rng, Grain::Fractal, 9.0),
            spots: Field::isotropic(rng, Grain::Cells, dirt.lichen_px),
            bloom: Field::sized(rng, Grain::Fractal, 30.0, 200.0),
            green: [0.30, 0.34, 0.14].map(|c| linear_from_srgb(c) * (0.3 * normal(rng)).exp()),
            crust: {
                let base = [[0.78, 0.78, 0.74], [0.80, 0.62, 0.20], [0.28, 0.28, 0.27]];
                let pick = (between(rng, 0.0, 3.0) as usize).min(2);
                base[pick].map(linear_from_srgb)
            },
            stain: [0.9, 0.8, 0.6].map(|c| c * (0.2 * normal(rng)).exp()),
            bright: chance(rng, 0.3),
            side: between(rng, 0.0, std::f32::consts::TAU),
            joints: between(rng, 0.0, 1.2),
        }
    }

    /// A colour under stains, runs, soot and salt.
    #[inline]
    fn stained(&self, mut colour: [f32; 3], [px, py]: [f32; 2]) -> [f32; 3] {
        let dirt = self.dirt;
        if dirt.stains > 0.0 {
            let amount = dirt.stains * smoothstep(-0.3, 1.2, self.blotches.at(px, py));
            let tone = if self.bright {
                1.0 + amount
            } else {
                1.0 - 0.8 * amount
            };
            colour = mix(scaled(colour, tone), product(colour, self.stain), 0.5 * amount);
        }
        if dirt.runs > 0.0 {
            let amount = dirt.runs * smoothstep(0.2, 0.2 + dirt.runs_softness, self.streaks.at(px, py));
            colour = scaled(colour, 1.0 - 0.8 * amount);
        }
        if dirt.soot > 0.0 {
            let along =
                (px / self.size[0] - 0.5) * self.side.cos() + (py / self.size[1] - 0.5) * self.side.sin();
            let amount = dirt.soot * smoothstep(-0.1, 0.6, along + 0.1 * self.clumps.at(px, py));
            colour = scaled(colour, 1.0 - 0.85 * amount);
        }
        if dirt.salt > 0.0 {
            let amount = dirt.salt * smoothstep(0.7, 2.0, self.bloom.at(px, py));
            colour = mix(colour, [0.75; 3], amount);
        }
        colour
    }

    /// How much lichen covers a place, 0 to 1.
    #[inline]
    fn lichen(&self, [px, py]: [f32; 2]) -> f32 {
        let share = self.dirt.lichen;
        let clumps = self.clumps.at(px, py);
        let radius = 0.75 * smoothstep(1.8 - 4.5 * share, 3.0 - 4.0 * share, clumps);
        let edge = self.spots.at(px, py) + 0.06 * self.tufts.at(px, py);
        smoothstep(radius, radius - 0.15, edge) * smoothstep(0.0, 0.1, radius)
    }

    /// How much moss covers a place, 0 to 1, and how high its tufts stand.
    #[inline]
    fn moss(&self, [px, py]: [f32; 2], openness: f32, is_joint: bool) -> (f32, f32) {
        let share = self.dirt.moss;
        let tuft = self.tufts.at(px, py);
        let wet = self.joints * (1.0 - openness) + if is_joint { 0.3 * self.joints } else { 0.0 };
        let grown = self.clumps.at(px, py) + 0.35 * tuft + wet;
        let amount = smoothstep(1.5 - 2.6 * share, 2.2 - 2.6 * share, grown);
        (amount, tuft)
    }
}

impl Dirt {
    /// A hole or a nail with rust around and below it.
    fn mark(&self, canvas: &mut Canvas, rng: &mut Rng) {
        let size = canvas.photo_size();
        let middle = size.map(|side| between(rng, 0.0, side));
        let radius = log_between(rng, 0.7, 5.0);
        let halo = radius * between(rng, 1.0, 5.0);
        let rust = sometimes(rng, 0.5, 0.1, 0.8);
        let (sin, cos) = self.down.sin_cos();
        let reach = (2.5 * halo + 2.0) * canvas.scale;
        let range = |axis: usize, count: usize| {
            let at = middle[axis] * canvas.scale;
            (at - reach).max(0.0) as usize..((at + reach) as usize).min(count)
        };

        for y in range(1, canvas.height) {
            for x in range(0, canvas.width) {
                let i = y * canvas.width + x;
                let p = canvas.photo(x, y);
                let (dx, dy) = (p[0] - middle[0], p[1] - middle[1]);
                let (below, aside) = (dx * cos + dy * sin, dx * sin - dy * cos);
                let stretched = if below > 0.0 { 0.5 * below } else { below };
                let amount = rust * smoothstep(halo, 0.0, stretched.hypot(aside));
                let hole = smoothstep(radius + 0.5, radius - 0.5, dx.hypot(dy));
                if !canvas.sky[i] {
                    let stained = mix(
                        canvas.albedo[i],
                        product(canvas.albedo[i], [0.7, 0.45, 0.2]),
                        amount,
                    );
                    canvas.albedo[i] = scaled(stained, 1.0 - 0.85 * hole);
                    canvas.relief[i] -= 0.6 * radius * hole;
                }
            }
        }
    }
}

fn product(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|c| a[c] * b[c])
}
