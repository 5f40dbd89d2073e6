//! The path of a zone over the epochs with its model and thresholds, and the conditions beneath on the same axis.

use crate::texts::Texts;
use std::fmt::Write;
use stonewise_figure::{Axes, Axis, escape};
use stonewise_results::calendar::year_of;
use stonewise_results::records::{ConditionRecord, CurvePoint, EstimateRecord, ZoneTrend};

/// Width of the picture, pixels.
const WIDTH: f64 = 760.0;
/// Left and right of the panels, pixels.
const SIDES: [f64; 2] = [56.0, 12.0];
/// Height of a panel of the motion and of a condition, and room beneath each, pixels.
const PANELS: [f64; 3] = [120.0, 84.0, 34.0];
/// Thresholds farther away than this many times the largest value are left out: they would flatten the path.
const FARTHEST_THRESHOLD: f64 = 2.0;
/// Half the width of a 95 % interval, standard deviations.
const Z: f64 = 1.96;
/// Days between two points of a curve that are not joined.
const GAP_DAYS: f64 = 45.0;

/// What the picture shows.
pub(crate) struct PathChart<'a> {
    pub title: &'a str,
    pub zone: &'a ZoneTrend,
    /// Labels of the panels: along the wall, up, out.
    pub labels: [&'a str; 3],
    pub conditions: &'a [ConditionRecord],
    pub limits_mm: &'a [f64],
    pub texts: &'a Texts,
}

/// The picture.
pub(crate) fn path_chart(chart: &PathChart) -> String {
    let [motion, condition, beneath] = PANELS;
    let panels = 3.0 * (motion + beneath) + chart.conditions.len() as f64 * (condition + beneath);
    let mut out = format!(
        r#"<svg role="img" aria-label="{}" viewBox="0 0 {WIDTH} {:.0}">"#,
        escape(chart.title),
        panels + 14.0
    );
    let times = chart.times();
    let heights = chart.heights_mm();
    let mut top = 6.0;

    let mut axes = |y: Axis, height: f64| {
        let area = [SIDES[0], top, WIDTH - SIDES[0] - SIDES[1], height];
        top += height + beneath;
        let x = chart.texts.axis("", times);
        Axes { x, y, area }
    };

    for (component, label) in chart.labels.iter().enumerate() {
        let axes = axes(chart.texts.axis(label, heights), motion);
        axes.draw(&mut out);
        chart.draw_motion(&axes, component, &mut out);
    }

    for record in chart.conditions {
        let readings: Vec<[f64; 2]> = record
            .readings
            .iter()
            .filter_map(|(date, value)| Some([year_of(date)?, *value]))
            .collect();
        let y = Axis {
            decimal: chart.texts.decimal,
            ..Axis::around(&record.name, readings.iter().map(|r| r[1]), false)
        };
        let axes = axes(y, condition);
        axes.draw(&mut out);
        for run in readings.chunk_by(|a, b| are_near(a[0], b[0])) {
            let _ = write!(out, r#"<path class="zero" d="{}"/>"#, line(&axes, run));
        }
        let at = |date: &String| record.readings.iter().find(|r| r.0 == *date).map(|r| r.1);
        let epochs: Vec<[f64; 2]> = chart
            .zone
            .path
            .iter()
            .filter_map(|p| Some([year_of(&p.date)?, at(&p.date)?]))
            .collect();
        let _ = write!(out, r#"<path class="dots a" d="{}"/>"#, dots(&axes, &epochs));
    }

    out.push_str("</svg>");
    out
}

impl PathChart<'_> {
    /// The first and the last day of the picture, years.
    fn times(&self) -> [f64; 2] {
        let days = self.zone.path.iter().map(|p| &p.date);
        let days = days.chain(self.zone.curve.iter().map(|p| &p.date));
        let ends = days
            .filter_map(|date| year_of(date))
            .fold([f64::MAX, f64::MIN], |[low, high], t| [low.min(t), high.max(t)]);
        let margin = 0.02 * (ends[1] - ends[0]);
        [ends[0] - margin, ends[1] + margin]
    }

    /// One range for the three components, so that they can be compared.
    fn heights_mm(&self) -> [f64; 2] {
        let ends = |e: &EstimateRecord| {
            (0..3)
                .flat_map(|k| [-Z, Z].map(|z| 1e3 * (e.value[k] + z * e.sd[k])))
                .collect::<Vec<f64>>()
        };
        let path = self.zone.path.iter();
        let all = path.flat_map(|p| {
            p.measured
                .iter()
                .chain([&p.model])
                .flat_map(ends)
                .collect::<Vec<f64>>()
        });
        let all = all.chain(self.zone.curve.iter().flat_map(|p| ends(&p.model)));
        let [low, high] = all.fold([0.0_f64, 0.0_f64], |[low, high], v| [low.min(v), high.max(v)]);
        let reach = FARTHEST_THRESHOLD * high.max(-low);
        let of = |mm: &f64| *mm <= reach;
        let highest = self
            .limits_mm
            .iter()
            .copied()
            .filter(|mm| of(mm))
            .fold(0.0, f64::max);
        let margin = 0.04 * (high.max(highest) - low.min(-highest));
        [low.min(-highest) - margin, high.max(highest) + margin]
    }

    fn draw_motion(&self, axes: &Axes, component: usize, out: &mut String) {
        let [left, _, width, _] = axes.area;
        let _ = write!(
            out,
            r#"<path class="zero" d="M{left} {:.1}h{width:.1}"/>"#,
            axes.py(0.0)
        );
        let lines = self
            .limits_mm
            .iter()
            .flat_map(|mm| [-mm, *mm])
            .filter(|mm| axes.y.holds(*mm));

        for mm in lines {
            let _ = write!(
                out,
                r#"<path class="limit" d="M{left} {:.1}h{width:.1}"/>"#,
                axes.py(mm)
            );
        }

        let joins = |a: &CurvePoint, b: &CurvePoint| {
            let near = year_of(&a.date)
                .zip(year_of(&b.date))
                .is_some_and(|(a, b)| are_near(a, b));
            near && a.extrapolated == b.extrapolated
        };

        let at = |date: &str, e: &EstimateRecord, z: f64| {
            Some([year_of(date)?, 1e3 * (e.value[component] + z * e.sd[component])])
        };

        for run in self.zone.curve.chunk_by(joins) {
            let side =
                |z: f64| -> Vec<[f64; 2]> { run.iter().filter_map(|p| at(&p.date, &p.model, z)).collect() };
            let ring: Vec<[f64; 2]> = side(Z).into_iter().chain(side(-Z).into_iter().rev()).collect();
            let class = if run[0].extrapolated {
                "curve beyond"
            } else {
                "curve"
            };
            let _ = write!(
                out,
                r#"<path class="band" d="{}z"/><path class="{class}" d="{}"/>"#,
                line(axes, &ring),
                line(axes, &side(0.0))
            );
        }

        if self.zone.curve.is_empty() {
            let model: Vec<[f64; 2]> = self
                .zone
                .path
                .iter()
                .filter_map(|p| at(&p.date, &p.model, 0.0))
                .collect();
            let _ = write!(out, r#"<path class="curve beyond" d="{}"/>"#, line(axes, &model));
        }

        let mut measured = Vec::new();
        for point in &self.zone.path {
            let Some(shown) = &point.measured else { continue };
            let ends = [-Z, 0.0, Z].map(|z| at(&point.date, shown, z));
            if let [Some(low), Some(middle), Some(high)] = ends {
                let _ = write!(
                    out,
                    r#"<path class="interval" d="{}"/>"#,
                    line(axes, &[low, high])
                );
                measured.push(middle);
            }
        }

        let _ = write!(out, r#"<path class="dots a" d="{}"/>"#, dots(axes, &measured));
    }
}

fn are_near(one: f64, other: f64) -> bool {
    (other - one).abs() * 365.25 <= GAP_DAYS
}

fn line(axes: &Axes, points: &[[f64; 2]]) -> String {
    let mut d = String::new();
    for (i, [x, y]) in points.iter().enumerate() {
        let letter = if i == 0 { "M" } else { "L" };
        let _ = write!(d, "{letter}{:.1} {:.1}", axes.px(*x), axes.py(*y));
    }
    d
}

fn dots(axes: &Axes, points: &[[f64; 2]]) -> String {
    points.iter().fold(String::new(), |mut d, [x, y]| {
        let _ = write!(d, "M{:.1} {:.1}h0", axes.px(*x), axes.py(*y));
        d
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texts::Texts;
    use stonewise_base::report_params::Language;
    use stonewise_core::series::Term;
    use stonewise_results::records::PathPoint;

    fn estimate(out: f64) -> EstimateRecord {
        EstimateRecord {
            value: [0.0, 0.0, out],
            sd: [1e-4; 3],
        }
    }

    fn zone() -> ZoneTrend {
        let dates = ["2023-01-01", "2023-07-02", "2024-01-01"];
        let out = |k: usize| 1e-3 * k as f64;
        ZoneTrend {
            epoch: "c".into(),
            zone_id: 1,
            stones: 4,
            confirmed_by: Vec::new(),
            velocity: [0.0; 3],
            sd: [0.0; 3],
            level: None,
            temperature: None,
            season: None,
            path: (0..3)
                .map(|k| PathPoint {
                    epoch: dates[k].into(),
                    date: dates[k].into(),
                    measured: (k != 1).then(|| estimate(out(k))),
                    model: estimate(out(k)),
                })
                .collect(),
            curve: (0..12)
                .map(|k| CurvePoint {
                    date: format!("2023-{:02}-01", k + 1),
                    model: estimate(1e-3 * k as f64 / 6.0),
                    extrapolated: k > 9,
                })
                .collect(),
            departure: None,
        }
    }

    #[test]
    fn path_model_thresholds_and_conditions_share_one_axis() {
        let zone = zone();
        let conditions = [ConditionRecord {
            term: Term::Level,
            name: "level_m".into(),
            readings: vec![("2023-01-01".into(), 150.0), ("2024-01-01".into(), 155.0)],
        }];
        let svg = path_chart(&PathChart {
            title: "Zone <1>",
            zone: &zone,
            labels: ["along", "up", "out"],
            conditions: &conditions,
            limits_mm: &[3.0, 60.0],
            texts: Texts::of(Language::English),
        });
        assert!(svg.contains("Zone &lt;1&gt;") && svg.contains("level_m") && !svg.contains("NaN"));
        // Two epochs with what they show in each of three panels; the band in two runs; one threshold on either side.
        assert_eq!(svg.matches("class=\"interval\"").count(), 6);
        assert_eq!(svg.matches("class=\"band\"").count(), 6);
        assert_eq!(svg.matches("class=\"limit\"").count(), 6);
        // The epochs stand at the same place in the panels of the motion and of the level.
        let xs: Vec<&str> = svg
            .split("class=\"dots a\" d=\"M")
            .skip(1)
            .map(|rest| rest.split(' ').next().unwrap())
            .collect();
        assert_eq!(xs.len(), 4);
        assert!(xs.iter().all(|x| *x == xs[0]), "{xs:?}");
    }
}
