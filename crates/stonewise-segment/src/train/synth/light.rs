//! Light: sun and sky on the relief, shadows in the joints, and shadows of things outside the photo.

use super::canvas::Canvas;
use super::draw::{Rng, between, chance, log_between, normal, smoothstep, sometimes};
use super::noise::{Field, Grain};
use std::f32::consts::{FRAC_PI_2, TAU};

/// The light of a photo.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Where the sun stands: direction in the photo, radians from x towards y. From above is -pi/2.
    pub azimuth: f32,
    /// Angle of the sun over the wall, radians, 0.12 (raking) to 1.4.
    pub elevation: f32,
    /// Share of the light that comes from the sky, 0.12 (hard sun) to 0.95 (overcast).
    pub ambient: f32,
    /// Colour of the sun's light, about 1.
    pub sun_colour: [f32; 3],
    /// Colour of the sky's light, about 1.
    pub sky_colour: [f32; 3],
    /// Shadows of things outside the photo.
    pub cast: Vec<CastShadow>,
}

/// A shadow that falls on the wall from something outside the photo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CastShadow {
    /// Everything on one side of a line: a roof, a wall, a hill.
    Edge {
        /// A point on the line in parts of the photo's width and height.
        through: [f32; 2],
        /// Direction to the shadow's inside, radians.
        angle: f32,
        /// Width over which the light falls off, pixels, 1 to 40.
        softness_px: f32,
    },
    /// A bar: a pole, a cable, a beam.
    Bar {
        /// A point on its axis in parts of the photo's width and height.
        through: [f32; 2],
        /// Direction across the bar, radians.
        angle: f32,
        /// Half its width, pixels, 1.5 to 40.
        half_width_px: f32,
        /// Width over which the light falls off, pixels, 1 to 15.
        softness_px: f32,
    },
    /// Leaves and branches.
    Foliage {
        /// Size of the largest clumps, pixels, 20 to 200.
        size_px: f32,
        /// Share of the light that is kept away, about 0.2 to 0.8.
        density: f32,
    },
}

impl Light {
    /// A light drawn at random: overcast, sunny or raking.
    pub(super) fn random(rng: &mut Rng) -> Self {
        let overcast = chance(rng, 0.4);
        let warmth = between(rng, 0.0, 0.18);
        Self {
            azimuth: if chance(rng, 0.85) {
                -FRAC_PI_2 + 0.8 * normal(rng)
            } else {
                between(rng, 0.0, TAU)
            },
            elevation: if chance(rng, 0.2) {
                between(rng, 0.12, 0.35)
            } else {
                between(rng, 0.35, 1.4)
            },
            ambient: if overcast {
                between(rng, 0.6, 0.95)
            } else {
                between(rng, 0.12, 0.5)
            },
            sun_colour: [1.0 + warmth, 1.0, 1.0 - warmth],
            sky_colour: [1.0 - 0.6 * warmth, 1.0, 1.0 + warmth],
            cast: if overcast && chance(rng, 0.8) {
                Vec::new()
            } else {
                let count = (0..3).filter(|_| chance(rng, 0.35)).count();
                (0..count).map(|_| CastShadow::random(rng)).collect()
            },
        }
    }

    /// The light that each sample sends to the camera; a flat white surface in full light sends 1.
    pub(super) fn shade(&self, canvas: &Canvas, rng: &mut Rng) -> Vec<[f32; 3]> {
        let mut lit = vec![1.0; canvas.label.len()];
        for shadow in &self.cast {
            shadow.fall(canvas, &mut lit, rng);
        }
        let (sin, cos) = self.elevation.sin_cos();
        let towards = [cos * self.azimuth.cos(), cos * self.azimuth.sin(), sin];
        let sun = (1.0 - self.ambient) / sin.max(0.3);
        let (width, height) = (canvas.width, canvas.height);
        let reach = Reach::new(canvas, towards);
        let mut radiance = vec![[0.0; 3]; width * height];

        for y in 0..height {
            let (above, below) = (y.saturating_sub(1), (y + 1).min(height - 1));
            for x in 0..width {
                let i = y * width + x;
                let (left, right) = (x.saturating_sub(1), (x + 1).min(width - 1));
                let relief = &canvas.relief;
                let slope_x = 0.5 * canvas.scale * (relief[y * width + right] - relief[y * width + left]);
                let slope_y = 0.5 * canvas.scale * (relief[below * width + x] - relief[above * width + x]);
                let shrink = 1.0 / (1.0 + slope_x * slope_x + slope_y * slope_y).sqrt();
                let facing = (towards[2] - slope_x * towards[0] - slope_y * towards[1]).max(0.0) * shrink;
                let lit = if canvas.sky[i] {
                    1.0
                } else {
                    lit[i] * canvas.facing[i]
                };
                let direct = if lit > 0.0 && facing > 0.0 {
                    sun * facing * lit * reach.light(relief, x, y)
                } else {
                    0.0
                };
                // Faces turned upwards see more of the sky.
                let sky =
                    self.ambient * canvas.openness[i] * (0.7 + 0.3 * shrink) * (1.0 + 0.3 * slope_y * shrink);
                let sky = sky.max(0.0);
                let albedo = canvas.albedo[i];
                radiance[i] = [0, 1, 2]
                    .map(|c: usize| albedo[c] * (direct * self.sun_colour[c] + sky * self.sky_colour[c]));
            }
        }

        radiance
    }
}

/// Steps towards the sun along which the relief may stand in the light.
struct Reach {
    /// Offsets in samples and the height that the ray gains, pixels of the photo.
    steps: Vec<(i32, i32, f32)>,
    width: i32,
    height: i32,
}

impl Reach {
    fn new(canvas: &Canvas, towards: [f32; 3]) -> Self {
        let (low, high) = canvas
            .relief
            .iter()
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &h| {
                (low.min(h), high.max(h))
            });
        let flat = towards[0].hypot(towards[1]);
        let rise = towards[2] / flat.max(1e-3);
        let farthest = ((high - low) / rise).min(40.0) * canvas.scale;
        let mut steps = Vec::new();
        let mut distance = 1.0;
        while distance <= farthest && steps.len() < 8 {
            let offset = |axis: usize| (towards[axis] / flat.max(1e-3) * distance).round() as i32;
            steps.push((offset(0), offset(1), distance / canvas.scale * rise));
            distance *= 1.6;
        }
        Self {
            steps,
            width: canvas.width as i32,
            height: canvas.height as i32,
        }
    }

    /// Share of the sun's light that the relief lets through, 0 to 1.
    #[inline]
    fn light(&self, relief: &[f32], x: usize, y: usize) -> f32 {
        let (x, y) = (x as i32, y as i32);
        let here = relief[(y * self.width + x) as usize];
        let mut excess = 0.0f32;
        for &(dx, dy, rise) in &self.steps {
            let (px, py) = (x + dx, y + dy);
            if px < 0 || py < 0 || px >= self.width || py >= self.height {
                break;
            }
            excess = excess.max(relief[(py * self.width + px) as usize] - here - rise);
        }
        1.0 - smoothstep(0.0, 0.5, excess)
    }
}

impl CastShadow {
    fn random(rng: &mut Rng) -> Self {
        let through = [between(rng, 0.0, 1.0), between(rng, 0.0, 1.0)];
        let angle = between(rng, 0.0, TAU);
        match between(rng, 0.0, 1.0) {
            p if p < 0.45 => Self::Edge {
                through,
                angle,
                softness_px: log_between(rng, 1.0, 40.0),
            },
            p if p < 0.75 => Self::Bar {
                through,
                angle,
                half_width_px: log_between(rng, 1.5, 40.0),
                softness_px: log_between(rng, 1.0, 15.0),
            },
            _ => Self::Foliage {
                size_px: log_between(rng, 20.0, 200.0),
                density: between(rng, 0.2, 0.8),
            },
        }
    }

    /// Takes the sun away where the shadow falls.
    fn fall(&self, canvas: &Canvas, lit: &mut [f32], rng: &mut Rng) {
        let size = canvas.photo_size();
        let ragged = sometimes(rng, 0.4, 2.0, 20.0);
        let wave = Field::isotropic(rng, Grain::Fractal, 120.0);
        let leaves = match *self {
            Self::Foliage { size_px, .. } => Field::isotropic(rng, Grain::Fractal, size_px),
            _ => wave,
        };

        for y in 0..canvas.height {
            for x in 0..canvas.width {
                let p = canvas.photo(x, y);
                let across = |through: [f32; 2], angle: f32| {
                    let (sin, cos) = angle.sin_cos();
                    let bend = if ragged > 0.0 {
                        ragged * wave.at(p[0], p[1])
                    } else {
                        0.0
                    };
                    (p[0] - through[0] * size[0]) * cos + (p[1] - through[1] * size[1]) * sin + bend
                };
                let dark = match *self {
                    Self::Edge {
                        through,
                        angle,
                        softness_px,
                    } => smoothstep(-softness_px, softness_px, across(through, angle)),
                    Self::Bar {
                        through,
                        angle,
                        half_width_px,
                        softness_px,
                    } => smoothstep(
                        softness_px,
                        -softness_px,
                        across(through, angle).abs() - half_width_px,
                    ),
                    Self::Foliage { density, .. } => {
                        let threshold = 1.5 - 3.0 * density;
                        smoothstep(threshold - 0.25, threshold + 0.25, leaves.at(p[0], p[1]))
                    }
                };
                lit[y * canvas.width + x] *= 1.0 - dark;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    /// A step of 6 pixels across the middle, high on the left.
    fn step() -> Canvas {
        let mut canvas = Canvas::new(60, 20, 1.0);
        canvas.albedo.fill([0.5; 3]);
        for (i, height) in canvas.relief.iter_mut().enumerate() {
            *height = if i % 60 < 30 { 6.0 } else { 0.0 };
        }
        canvas
    }

    fn sun_from(azimuth: f32, elevation: f32) -> Light {
        Light {
            azimuth,
            elevation,
            ambient: 0.2,
            sun_colour: [1.0; 3],
            sky_colour: [1.0; 3],
            cast: Vec::new(),
        }
    }

    #[test]
    fn flat_wall_sends_its_albedo_under_a_high_sun() {
        let mut canvas = Canvas::new(16, 16, 1.0);
        canvas.albedo.fill([0.25, 0.5, 0.75]);
        let mut rng = Rng::seed_from_u64(0);
        let radiance = sun_from(1.0, 0.8).shade(&canvas, &mut rng);
        for (sent, albedo) in radiance[100].iter().zip([0.25, 0.5, 0.75]) {
            assert!((sent - albedo).abs() < 1e-5);
        }
    }

    #[test]
    fn a_step_throws_a_shadow_as_long_as_the_sun_is_low() {
        let mut rng = Rng::seed_from_u64(0);
        // Height 6 under 45 degrees: shadow to 6 pixels beyond the step, on the side away from the sun only.
        let radiance = sun_from(std::f32::consts::PI, 0.25 * std::f32::consts::PI).shade(&step(), &mut rng);
        let row = |x: usize| radiance[10 * 60 + x][0];
        assert!(row(33) < 0.3 * row(50), "{} {}", row(33), row(50));
        assert!((row(40) - row(50)).abs() < 1e-5);
        let radiance = sun_from(0.0, 0.25 * std::f32::consts::PI).shade(&step(), &mut rng);
        let row = |x: usize| radiance[10 * 60 + x][0];
        assert!((row(33) - row(50)).abs() < 1e-5);
    }
}
