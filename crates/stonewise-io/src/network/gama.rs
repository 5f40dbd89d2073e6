//! The XML of gama-local (GNU Gama 2, `gnu_gama/xml/localnetwork_adjustment_results`).
//!
//! Adjusted points are listed with x, y and z where each is adjusted, capitals where it also holds the datum; fixed ones
//! apart. The covariance has their coordinates in this order and then the orientations, mm^2; it is the upper part of a
//! band, row by row. Where axes and angles turn in different directions Gama computes with y reversed: coordinates are
//! turned back when they are written, covariances are not.

use super::{AdjustedCoordinate, Begins, NetworkError, Raw, error, number, text_of};
use crate::xml::{Element, parse};
use nalgebra::DMatrix;
use std::path::Path;

/// Of covariances: m^2 in mm^2.
const M2_PER_MM2: f64 = 1e-6;

pub(super) fn read(path: &Path) -> Result<(Raw, Begins), NetworkError> {
    let text = text_of(path)?;
    let document = parse(&text).map_err(|e| error(path, e.line as usize, e.problem))?;
    let at = |element: Element<'_>, message: String| error(path, element.line(), message);
    let root = Element::root(&document);
    if root.name() != "gama-local-adjustment" {
        let message = format!(
            "<{}> is no result of gama-local: write one with `gama-local NETWORK.gkf --xml FILE`",
            root.name()
        );
        return Err(at(root, message));
    }
    if let Some(failed) = root.child("error") {
        let said: Vec<String> = failed.all("description").map(Element::text).collect();
        return Err(at(failed, format!("gama-local failed: {}", said.join(" "))));
    }
    let parameters = child(path, root, "network-general-parameters")?;
    let axes = Axes::of(parameters).map_err(|message| at(parameters, message))?;
    let coordinates = child(path, root, "coordinates")?;

    let mut raw = Raw::default();
    // Of each row, the sign of its covariances with others.
    let mut signs = Vec::new();
    for (kind, is_adjusted) in [("fixed", false), ("adjusted", true)] {
        for point in child(path, coordinates, kind)?.all("point") {
            let name = child(path, point, "id")?.text().trim().to_owned();
            let of = raw.point(&name, point.line());
            for (axis, names) in [["x", "X"], ["y", "Y"], ["z", "Z"]].into_iter().enumerate() {
                let Some(found) = names.into_iter().find_map(|name| point.child(name)) else {
                    continue;
                };
                let value = number(&found.text()).map_err(|message| at(found, message))?;
                let to = axes.axes[axis];
                if of.place[to.axis].replace(to.sign * value).is_some() {
                    return Err(at(point, format!("{name} is there twice: remove one")));
                }
                if is_adjusted {
                    of.adjusted[to.axis] = Some(AdjustedCoordinate {
                        value_m: to.sign * value,
                        row: signs.len(),
                    });
                    signs.push(to.covariance_sign);
                }
            }
        }
    }

    let matrix = child(path, coordinates, "cov-mat")?;
    let size = |name: &str| {
        let found = child(path, matrix, name)?;
        let text = found.text();
        text.trim()
            .parse::<usize>()
            .map_err(|_| at(found, format!("{text:?} is no size of a matrix")))
    };
    let (dimension, band, count) = (size("dim")?, size("band")?, signs.len());
    if dimension < count {
        let message = format!("<cov-mat> has {dimension} rows, and {count} coordinates are adjusted");
        return Err(at(matrix, message));
    }
    if count > band.saturating_add(1) {
        let message =
            format!("the covariance is cut to a band of {band}: run gama-local with `--cov-band -1`");
        return Err(at(matrix, message));
    }
    let mut values = matrix.all("flt");
    raw.covariance = DMatrix::zeros(count, count);
    for row in 0..count {
        for column in row..dimension.min(row.saturating_add(band).saturating_add(1)) {
            let missing = || at(matrix, "numbers are missing: is the file complete?".to_owned());
            let found = values.next().ok_or_else(missing)?;
            let value = number(&found.text()).map_err(|message| at(found, message))?;
            if column < count {
                let value = M2_PER_MM2 * signs[row] * signs[column] * value;
                raw.covariance[(row, column)] = value;
                raw.covariance[(column, row)] = value;
            }
        }
    }
    let begins = Begins {
        path: path.to_path_buf(),
        line: matrix.line(),
    };
    Ok((raw, begins))
}

/// The part of an element, which must be there.
fn child<'a>(path: &Path, of: Element<'a>, name: &str) -> Result<Element<'a>, NetworkError> {
    of.child(name).ok_or_else(|| {
        let message = format!("<{}> lacks <{name}>: is the file complete?", of.name());
        error(path, of.line(), message)
    })
}

/// Where the axes of a file point.
struct Axes {
    axes: [Axis; 3],
}

/// Where an axis points.
#[derive(Clone, Copy)]
struct Axis {
    /// 0 east, 1 north, 2 up.
    axis: usize,
    /// Negative to the west or the south.
    sign: f64,
    /// The sign in covariances.
    covariance_sign: f64,
}

impl Axes {
    fn of(parameters: Element<'_>) -> Result<Self, String> {
        let named = parameters.attribute("axes-xy").unwrap_or_default();
        let axis = |letter: u8| match letter {
            b'e' => Some((0, 1.0)),
            b'n' => Some((1, 1.0)),
            b'w' => Some((0, -1.0)),
            b's' => Some((1, -1.0)),
            _ => None,
        };
        let (x, y) = match named.as_bytes() {
            [x, y] => (axis(*x), axis(*y)),
            _ => (None, None),
        };
        let pair = x.zip(y).filter(|(x, y)| x.0 != y.0);
        let (x, y) = pair.ok_or_else(|| {
            format!(
                "axes-xy must be ne, sw, es, wn, en, nw, se or ws, as gama-local writes it, not {named:?}"
            )
        })?;
        let is_left_handed = (x.0 == 0) != (x.1 * y.1 > 0.0);
        let is_clockwise = match parameters.attribute("angles") {
            Some("left-handed") => true,
            Some("right-handed") => false,
            other => {
                return Err(format!(
                    "angles must be left-handed or right-handed, not {:?}",
                    other.unwrap_or_default()
                ));
            }
        };
        let y_sign = if is_left_handed == is_clockwise { 1.0 } else { -1.0 };
        let axis = |(axis, sign), covariance_sign: f64| Axis {
            axis,
            sign,
            covariance_sign: sign * covariance_sign,
        };
        Ok(Self {
            axes: [axis(x, 1.0), axis(y, y_sign), axis((2, 1.0), 1.0)],
        })
    }
}
