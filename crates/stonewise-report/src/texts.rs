//! The texts of the verdict and of the report, which `stonewise-base/texts` holds in each language.

use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::sync::{LazyLock, Mutex, PoisonError};
pub(crate) use stonewise_base::messages::fill;
use stonewise_base::profile::Profile;
use stonewise_base::report_params::Language;
use stonewise_base::thresholds::Quantity;
use stonewise_figure::{Axis, count, mm, number, percent};
use stonewise_results::Status;
use stonewise_results::records::State;

/// A text for one and a text for several.
type Number = [&'static str; 2];

/// Texts of one language; words in braces are filled in.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, bound(deserialize = "'de: 'static"))]
pub(crate) struct Texts {
    #[serde(skip)]
    pub language: Language,
    /// What stands between the whole part of a number and its decimals.
    #[serde(skip)]
    pub decimal: &'static str,
    pub states: States,
    pub clauses: Clauses,
    pub page: PageTexts,
    pub sections: SectionTexts,
    pub stones: StoneTexts,
    pub maps: MapTexts,
    pub charts: ChartTexts,
    pub accuracy: AccuracyTexts,
    pub checks: CheckTexts,
    pub influence: InfluenceTexts,
    pub scores: ScoreTexts,
    pub method: MethodTexts,
    pub audit: AuditTexts,
    pub series: SeriesTexts,
    pub instruments: InstrumentTexts,
    pub yearly: YearlyTexts,
    /// What became of stones, in the order of [`Status::ALL`].
    pub statuses: [&'static str; 10],
    /// Errors of a stone's budget, in the order of [`stonewise_results::Term::ALL`].
    pub terms: [&'static str; 7],
    /// Usual conditions of an epoch, by their English names.
    conditions: BTreeMap<&'static str, &'static str>,
}

/// Declares groups of texts: first the single ones, then lists and texts for one and for several.
macro_rules! groups {
    ($(
        $(#[$doc:meta])*
        $name:ident {
            $($text:ident),* $(; $($(#[$of:meta])* $field:ident: $kind:ty,)*)?
        }
    )*) => {$(
        $(#[$doc])*
        #[derive(Debug, Default, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub(crate) struct $name {
            $(pub $text: &'static str,)*
            $($($(#[$of])* pub $field: $kind,)*)?
        }
    )*};
}

groups! {
    /// Words for the states.
    States {
        fine, attention, alarm, cannot_tell
    }

    /// What the verdict's sentence is made of.
    Clauses {
        not_converged, in_doubt, rate_not_judged, departure_not_judged, mm_a_year, standard_deviations,
        largest, largest_common, largest_of_these, nothing_measured, datum_unknown, none_against_common,
        none_shown, pressed_in, diameter, sides, shape_kept, shape_kept_within, limit, limit_common, or,
        elsewhere;
        apparent: Number,
        /// What lies beyond a threshold: motion, motion against neighbours, joint opening, deformation, velocity, departure.
        beyond: [Number; 6],
        /// Attention, alarm.
        levels: [&'static str; 2],
        moved: Number,
        moved_common: Number,
        loose: Number,
        lost: Number,
        few_measured: Number,
        reaches: Number,
        joints_reach: Number,
        stones_or_joints_reach: Number,
        below: Number,
        below_with_joints: Number,
        not_measured: Number,
        deformed_reaches: Number,
        deformed: Number,
        /// A zone of deformation by what it resembles, and a bulge into the wall.
        shape: [&'static str; 5],
        /// What a zone moved against: the rest of the wall, of its part of the wall.
        against: [&'static str; 2],
        /// What has thresholds.
        quantities: [&'static str; 9],
    }

    /// The report's first page.
    PageTexts {
        kind, epochs, date, conditions, reference, operator, instruments, calibration, reference_number,
        not_measured, all_measured, no_thresholds, look_first, nothing_first, look_at_doubt, none_stands_out, stone,
        along_up, lost_stone, moved_stone, moved_stone_common, loose_stone, opened_joint, zones, zone, state,
        stones, measured, moved, largest, assessor, signature, signed, signed_others, remarks, wall,
        place_date, tile_measured, tile_moved, tile_moved_common, tile_loose, tile_largest,
        tile_largest_common, tile_no_motion, tile_cannot_tell, limit_unknown, registration_included,
        registration_in_doubt, registration_unknown, registration_unknown_in_doubt, chance, doubts,
        in_numbers, as_computed, summary, finished, map_title, map_colours, map_note, map_note_in_doubt,
        map_as_measured, map_zones, section_title, section_place, section_out, no_registration;
        of_not_measured: Number,
        /// What to do next: of a wall that is fine, of one that is not, of one of which nothing can be told.
        next: [&'static str; 3],
        section_note: [&'static str; 2],
    }

    /// Names of sections, in the bar that leads to them and as headings.
    SectionTexts {
        maps, tables, distributions, datum, datum_title, evaluation, evaluation_title, method, method_title,
        audit, title_end, survey, epoch
    }

    /// The summary in numbers, and the tables of stones.
    StoneTexts {
        median, none_loose, one_loose, some_loose, between, all_over, nine_tenths, largest_tenth, outcomes,
        status, meaning, stones, share, largest, loose_stones, by_reason, stone, along, up, d_along, d_up,
        d_out, norm, limit, neighbours, rotation, loose, rest, stretches, stretch, measured, above
    }

    /// The maps.
    MapTexts {
        above, below, unmeasured, loose, edited, carried, intro, beyond, shape, shape_note, shape_faded,
        along, along_note, up, up_note, out, out_note, m3c2, m3c2_note, opening, opening_note, opening_faded,
        relative, relative_note, limit, limit_note, rotation, rotation_note, axis_along, axis_up,
        axis_up_short, in_plane
    }

    /// The charts, and the check of the datum.
    ChartTexts {
        along, up, out, displacement, cross, axis_along, axis_up, axis_out, stones_title, stones, m3c2_title,
        m3c2, out_title, out_note, direction, all_median, all_nmad, below_median, below_nmad, datum,
        datum_below, nmad, nmad_below, estimated, and, known, unknown
    }

    /// Required and achieved accuracy, and the budget of the largest motion.
    AccuracyTexts {
        heading, intro, none_stated, budget, combined, expanded, budget_note;
        /// Quantity, requirement, achieved: median and 90th percentile, how many stones keep it.
        columns: [&'static str; 5],
        /// Source, type, three axes, share.
        budget_columns: [&'static str; 6],
    }

    /// The checks of the run.
    CheckTexts {
        heading, intro, check, epoch, value, limit, source, outcome, at_least, at_most, passed, failed
    }

    /// What the results rest on.
    InfluenceTexts {
        heading, intro, name, redundancy, blunder, without, shift
    }

    /// The score against a known motion.
    ScoreTexts {
        stones, stones_external, truth, rmse_title, rmse_note, definitions, along, up, per_axis, in_plane,
        out, space, method, count, zero, direction, rmse, mean, median, nmad, p95, outliers, zero_mm, covers,
        estimated, significance, chi, loose, found
    }

    /// Method, terms and limits of the statement, as HTML.
    MethodTexts {
        body
    }

    /// Survey data, warnings, decisions, parameters.
    AuditTexts {
        survey, epoch, date, conditions, clouds, points, cameras, views, photos, masks, detector, stones,
        motion, none, local, coordinates, no_run, steps, epochs, parameters, part, adjustment, step, seconds,
        processor, memory, origin, resumed, decision_of, decisions, decision_list, decision_rest,
        many_records, decision, photo, instance, of_stones, share, edits, edits_note, carried, carried_note,
        no_warnings, warnings, about, happened, input, left_out, merged, split, joined, outvoted,
        dropped_islands, dropped_stone
    }

    /// What the four answers are made of.
    SeriesTexts {
        heading, question, answer, intro, cannot_tell, no_trend, predicted, past, no_anomaly, few_epochs,
        nothing_measured, may_be, model, not_given, too_few, same, same_season, two_seasons, goes_with,
        undated, by_level, by_temperature, by_season, departs, confirmed, unconfirmed, path, path_note,
        beyond, beyond_season, map, map_unit, map_note;
        words: [&'static str; 3],
        /// The four questions: as predicted, as in the past, trend, anomaly.
        questions: [&'static str; 4],
        trend: Number,
        not_predicted: Number,
        not_past: Number,
        anomaly: Number,
        /// Trend, level, temperature, season.
        terms: [&'static str; 4],
        zone: Number,
        /// Axes of the path: along the wall, up, out.
        components: [&'static str; 3],
    }

    /// What the section on other instruments is made of.
    InstrumentTexts {
        heading, intro, together, not_compared, no_date, before, after, gap, no_stones;
        /// Name, instrument, stones around it, difference, agreement.
        columns: [&'static str; 5],
        /// It agrees, it does not, cannot tell.
        words: [&'static str; 3],
        /// Observed, undetermined, contradicted.
        uses: [&'static str; 3],
    }

    /// What the part of the yearly safety report on measurements is made of.
    YearlyTexts {
        kind, method, condition, results_note, of, interval, no_zones, not_separable, to_write, prepared,
        files;
        headings: YearlyHeadings,
        /// Epoch, date, clouds, photos, points, stones, registration.
        survey: [&'static str; 7],
        /// Stable areas, stated, sources, other instruments, unknown.
        datums: [&'static str; 5],
        /// Epoch, state, measured, moved, loose, lost, largest motion, largest deformation, detection limit.
        results: [&'static str; 9],
        conclusions: [&'static str; 4],
    }

    /// Headings of its chapters.
    YearlyHeadings {
        survey, conditions, results, prediction, interpretation, conclusion, signature
    }
}

impl Clauses {
    /// What lies beyond a threshold of a quantity; `{level}` is one of the levels.
    pub(crate) fn beyond(&self, quantity: Quantity) -> Number {
        let [motion, neighbours, joints, deformation, rate, departure] = self.beyond;
        match quantity {
            Quantity::Length | Quantity::Out | Quantity::Up | Quantity::Along => motion,
            Quantity::Neighbours => neighbours,
            Quantity::Joints => joints,
            Quantity::Deformation => deformation,
            Quantity::Rate => rate,
            Quantity::Departure => departure,
        }
    }

    /// The detection limit: of absolute motions, or of those against the common motion of the wall.
    pub(crate) fn detection_limit(&self, has_datum: bool) -> &'static str {
        if has_datum { self.limit } else { self.limit_common }
    }
}

impl Texts {
    /// The texts of a language.
    pub(crate) fn of(language: Language) -> &'static Self {
        static TEXTS: LazyLock<[Texts; Language::ALL.len()]> =
            LazyLock::new(|| Language::ALL.map(|language| language.read::<Texts>("report").within(language)));
        &TEXTS[language as usize]
    }

    /// The texts of a language with the words of a profile; kept for good, once for each of both.
    pub(crate) fn with(language: Language, profile: &Profile) -> &'static Self {
        static KEPT: Mutex<BTreeMap<String, &'static Texts>> = Mutex::new(BTreeMap::new());
        let Some(words) = profile.words(language) else {
            return Self::of(language);
        };
        let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
        let key = format!("{} {words}", language.tag());
        if let Some(texts) = kept.get(&key).copied() {
            return texts;
        }
        let mut report: Value = language.read("report");
        replace(&mut report, words);
        // A profile was checked when it was read.
        let texts = Self::deserialize(&*Box::leak(Box::new(report))).unwrap_or_default();
        let texts: &'static Self = Box::leak(Box::new(texts.within(language)));
        kept.insert(key, texts);
        texts
    }

    fn within(self, language: Language) -> Self {
        Self {
            language,
            decimal: language.text("language.decimal"),
            ..self
        }
    }

    /// The word for a state.
    pub(crate) fn state(&self, state: State) -> &'static str {
        match state {
            State::Fine => self.states.fine,
            State::Attention => self.states.attention,
            State::Alarm => self.states.alarm,
            State::CannotTell => self.states.cannot_tell,
        }
    }

    /// What a project calls a condition of an epoch, without its unit, in words; names that are not in the
    /// list stay as they are.
    pub(crate) fn condition(&self, name: &str) -> String {
        let words = name.replace('_', " ");
        let english = words.to_lowercase();
        match self.conditions.get(english.as_str()) {
            Some(known) if *known != english => (*known).to_owned(),
            _ => words,
        }
    }

    /// What became of a stone.
    pub(crate) fn status(&self, status: Status) -> &'static str {
        self.statuses[status as usize]
    }

    /// A number with this many decimals.
    pub(crate) fn number(&self, value: f64, decimals: usize) -> String {
        number(value, decimals).replace('.', self.decimal)
    }

    /// Metres as millimetres with the digits that mean something.
    pub(crate) fn mm(&self, metres: f64) -> String {
        mm(metres).replace('.', self.decimal)
    }

    /// Metres as millimetres, or a dash where the value is missing.
    pub(crate) fn mm_or_dash(&self, metres: Option<f64>) -> String {
        self.mm(metres.unwrap_or(f64::NAN))
    }

    /// A share as a percentage.
    pub(crate) fn percent(&self, part: usize, whole: usize) -> String {
        percent(part, whole).replace('.', self.decimal)
    }

    /// A linear axis whose numbers are written as in this language.
    pub(crate) fn axis(&self, label: &str, range: [f64; 2]) -> Axis {
        Axis {
            decimal: self.decimal,
            ..Axis::linear(label, range)
        }
    }

    /// A threshold with its unit.
    pub(crate) fn limit(&self, quantity: Quantity, limit: f64) -> String {
        let unit = match quantity {
            Quantity::Rate => self.clauses.mm_a_year,
            Quantity::Departure => self.clauses.standard_deviations,
            _ => "mm",
        };
        format!("{} {unit}", self.threshold(limit))
    }

    /// A threshold in millimetres, as short as it can be.
    pub(crate) fn threshold(&self, millimetres: f64) -> String {
        let rounded = (millimetres * 1e3).round() / 1e3;
        rounded.to_string().replace('.', self.decimal)
    }
}

/// Puts words in the places of texts.
fn replace(texts: &mut Value, words: &Value) {
    match (texts, words) {
        (Value::Object(texts), Value::Object(words)) => {
            for (name, word) in words {
                replace(texts.entry(name.as_str()).or_insert(Value::Null), word);
            }
        }
        (text, word) => *text = word.clone(),
    }
}

/// The text for this number of things, with `{n}` filled in.
pub(crate) fn counted(texts: Number, n: usize, values: &[(&str, &str)]) -> String {
    let text = fill(texts[usize::from(n != 1)], &[("n", &count(n))]);
    fill(&text, values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_has_the_texts_and_no_others() {
        for language in Language::ALL {
            let report: &'static Value = Box::leak(Box::new(language.read("report")));
            assert!(
                Texts::deserialize(report).is_ok(),
                "{}: {:?}",
                language.tag(),
                Texts::deserialize(report).err()
            );
        }
    }

    #[test]
    fn outcomes_are_those_of_the_tables() {
        let english = Texts::of(Language::English);
        for (i, status) in Status::ALL.into_iter().enumerate() {
            assert_eq!((status as usize, english.status(status)), (i, status.meaning()));
        }
    }

    #[test]
    fn one_and_many_are_told_apart() {
        let english = Texts::of(Language::English);
        let clauses = &english.clauses;
        assert_eq!(
            counted(
                clauses.beyond(Quantity::Joints),
                1,
                &[("t", "5 mm"), ("level", clauses.levels[1])]
            ),
            "1 joint opened beyond the alarm threshold of 5 mm"
        );
        assert!(counted(clauses.lost, 2, &[]).starts_with("2 stones are lost"));
        let german = Texts::of(Language::German);
        assert_eq!(german.mm(0.000_24), "0,24");
        assert_eq!(german.threshold(2.5), "2,5");
        assert_eq!(english.threshold(10.0), "10");
        let conditions = |texts: &Texts| ["Air_Temperature", "mood"].map(|name| texts.condition(name));
        assert_eq!(conditions(english), ["Air Temperature", "mood"]);
        assert_eq!(conditions(german), ["Lufttemperatur", "mood"]);
    }
}
