//! The texts of the verdict and of the report, in each language.

mod instruments;
mod report;
mod series;
mod yearly;

pub(crate) use instruments::InstrumentTexts;
pub(crate) use report::{
    AuditTexts, ChartTexts, CheckTexts, InfluenceTexts, MapTexts, MethodTexts, ScoreTexts, SectionTexts, StoneTexts,
};
pub(crate) use series::SeriesTexts;
pub(crate) use stonewise_base::messages::fill;
use stonewise_base::report_params::Language;
use stonewise_base::thresholds::Quantity;
use stonewise_figure::{Axis, count, mm, number, percent};
use stonewise_results::Status;
use stonewise_results::records::State;
pub(crate) use yearly::YearlyTexts;

/// A text for one and a text for several.
type Number = [&'static str; 2];

/// Texts of one language; words in braces are filled in.
#[derive(Debug)]
pub(crate) struct Texts {
    /// The language (BCP 47).
    pub tag: &'static str,
    /// What stands between the whole part of a number and its decimals.
    pub decimal: &'static str,
    pub states: States,
    pub clauses: Clauses,
    pub page: PageTexts,
    pub sections: SectionTexts,
    pub stones: StoneTexts,
    pub maps: MapTexts,
    pub charts: ChartTexts,
    pub checks: CheckTexts,
    pub influence: InfluenceTexts,
    pub scores: ScoreTexts,
    pub method: MethodTexts,
    pub audit: AuditTexts,
    pub series: &'static SeriesTexts,
    pub instruments: &'static InstrumentTexts,
    pub yearly: &'static YearlyTexts,
    /// What became of stones, in the order of [`Status::ALL`].
    pub statuses: [&'static str; 10],
    /// Errors of a stone's budget, in the order of [`stonewise_results::Term::ALL`].
    pub terms: [&'static str; 7],
}

/// Words for the states.
#[derive(Debug)]
pub(crate) struct States {
    pub fine: &'static str,
    pub attention: &'static str,
    pub alarm: &'static str,
    pub cannot_tell: &'static str,
}

/// What the verdict's sentence is made of.
#[derive(Debug)]
pub(crate) struct Clauses {
    pub not_converged: &'static str,
    pub in_doubt: &'static str,
    pub apparent: Number,
    /// What lies beyond a threshold: motion, motion against neighbours, joint opening, deformation, velocity, departure.
    beyond: [Number; 6],
    /// Attention, alarm.
    pub levels: [&'static str; 2],
    pub rate_not_judged: &'static str,
    pub departure_not_judged: &'static str,
    pub mm_a_year: &'static str,
    pub standard_deviations: &'static str,
    pub moved: Number,
    pub moved_common: Number,
    pub loose: Number,
    pub lost: Number,
    pub largest: &'static str,
    pub largest_common: &'static str,
    pub largest_of_these: &'static str,
    pub nothing_measured: &'static str,
    pub few_measured: Number,
    pub datum_unknown: &'static str,
    pub none_against_common: &'static str,
    pub reaches: Number,
    pub joints_reach: Number,
    pub stones_or_joints_reach: Number,
    pub below: Number,
    pub below_with_joints: Number,
    pub none_shown: &'static str,
    pub not_measured: Number,
    pub deformed_reaches: Number,
    pub deformed: Number,
    /// A zone of deformation by what it resembles, and a bulge into the wall.
    pub shape: [&'static str; 5],
    pub pressed_in: &'static str,
    /// Size of a round zone, and of another one.
    pub diameter: &'static str,
    pub sides: &'static str,
    /// What a zone moved against: the rest of the wall, of its part of the wall.
    pub against: [&'static str; 2],
    pub shape_kept: &'static str,
    pub shape_kept_within: &'static str,
    limit: &'static str,
    limit_common: &'static str,
    pub or: &'static str,
    /// What has thresholds.
    pub quantities: [&'static str; 9],
    /// Outside the zones, and in zones that have no threshold of their own.
    pub elsewhere: &'static str,
}

/// The report's first page.
#[derive(Debug)]
pub(crate) struct PageTexts {
    pub kind: &'static str,
    pub epochs: &'static str,
    pub date: &'static str,
    pub conditions: &'static str,
    pub reference: &'static str,
    pub operator: &'static str,
    pub instruments: &'static str,
    pub reference_number: &'static str,
    pub not_measured: &'static str,
    pub all_measured: &'static str,
    pub of_not_measured: Number,
    /// What to do next: of a wall that is fine, of one that is not, of one of which nothing can be told.
    pub next: [&'static str; 3],
    pub no_thresholds: &'static str,
    pub look_first: &'static str,
    pub nothing_first: &'static str,
    pub look_at_doubt: &'static str,
    pub none_stands_out: &'static str,
    pub stone: &'static str,
    pub along_up: &'static str,
    pub lost_stone: &'static str,
    pub moved_stone: &'static str,
    pub moved_stone_common: &'static str,
    pub loose_stone: &'static str,
    pub opened_joint: &'static str,
    pub zones: &'static str,
    pub zone: &'static str,
    pub state: &'static str,
    pub stones: &'static str,
    pub measured: &'static str,
    pub moved: &'static str,
    pub largest: &'static str,
    pub assessor: &'static str,
    pub signature: &'static str,
    pub signed: &'static str,
    pub signed_others: &'static str,
    pub remarks: &'static str,
    pub wall: &'static str,
    pub place_date: &'static str,
    pub tile_measured: &'static str,
    pub tile_moved: &'static str,
    pub tile_moved_common: &'static str,
    pub tile_loose: &'static str,
    pub tile_largest: &'static str,
    pub tile_largest_common: &'static str,
    pub tile_no_motion: &'static str,
    pub tile_cannot_tell: &'static str,
    pub limit_unknown: &'static str,
    pub registration_included: &'static str,
    pub registration_in_doubt: &'static str,
    pub registration_unknown: &'static str,
    pub registration_unknown_in_doubt: &'static str,
    pub chance: &'static str,
    pub doubts: &'static str,
    pub in_numbers: &'static str,
    pub as_computed: &'static str,
    pub summary: &'static str,
    pub finished: &'static str,
    pub map_title: &'static str,
    pub map_colours: &'static str,
    pub map_note: &'static str,
    pub map_note_in_doubt: &'static str,
    pub map_as_measured: &'static str,
    pub map_zones: &'static str,
    pub section_title: &'static str,
    pub section_note: [&'static str; 2],
    pub section_place: &'static str,
    pub section_out: &'static str,
    pub no_registration: &'static str,
}

static ENGLISH: Texts = Texts {
    tag: "en",
    decimal: ".",
    states: States {
        fine: "Fine",
        attention: "Attention",
        alarm: "Alarm",
        cannot_tell: "Cannot tell",
    },
    clauses: Clauses {
        not_converged: "the adjustment did not converge, so its motions and intervals must not be relied on",
        in_doubt: "the results as a whole are in doubt and must not be relied on",
        apparent: [
            "as computed, {n} stone would lie beyond the alarm threshold",
            "as computed, {n} stones would lie beyond the alarm threshold",
        ],
        beyond: [
            [
                "{n} stone moved beyond the {level} threshold of {t}",
                "{n} stones moved beyond the {level} threshold of {t}",
            ],
            [
                "{n} stone moved against its neighbours beyond the {level} threshold of {t}",
                "{n} stones moved against their neighbours beyond the {level} threshold of {t}",
            ],
            [
                "{n} joint opened beyond the {level} threshold of {t}",
                "{n} joints opened beyond the {level} threshold of {t}",
            ],
            [
                "{n} zone deformed beyond the {level} threshold of {t}",
                "{n} zones deformed beyond the {level} threshold of {t}",
            ],
            [
                "{n} stone moves faster than the {level} threshold of {t}",
                "{n} stones move faster than the {level} threshold of {t}",
            ],
            [
                "{n} stone departs from what the series predicts beyond the {level} threshold of {t}",
                "{n} stones depart from what the series predicts beyond the {level} threshold of {t}",
            ],
        ],
        levels: ["attention", "alarm"],
        rate_not_judged: "velocities cannot be compared with their thresholds: give the dates of both epochs, or of three in a series",
        departure_not_judged: "departures from the model cannot be compared with their thresholds: a model needs four epochs with dates",
        mm_a_year: "mm a year",
        standard_deviations: "standard deviations",
        moved: [
            "{n} of {m} measured stones moved",
            "{n} of {m} measured stones moved",
        ],
        moved_common: [
            "{n} of {m} measured stones moved against the common motion of the wall",
            "{n} of {m} measured stones moved against the common motion of the wall",
        ],
        loose: [
            "{n} stone is loose: it moved unlike its neighbours",
            "{n} stones are loose: they moved unlike their neighbours",
        ],
        lost: [
            "{n} stone is lost: the later epoch shows its place without it",
            "{n} stones are lost: the later epoch shows their places without them",
        ],
        largest: "the largest motion is {length} mm (95 % interval {low} to {high} mm), stone {id}",
        largest_common: "the largest motion against the common motion of the wall is {length} mm (95 % interval {low} to {high} mm), stone {id}",
        largest_of_these: "the largest of these motions is {length} mm (95 % interval {low} to {high} mm), stone {id}",
        nothing_measured: "no stone was measured",
        few_measured: [
            "only {n} of {m} stones was measured",
            "only {n} of {m} stones were measured",
        ],
        datum_unknown: "the registration error between the surveys is unknown, so a motion of the wall as a whole would not show",
        none_against_common: "no stone moved against the common motion of the wall",
        reaches: [
            "{n} stone may have reached the attention threshold of {t}: its interval extends to it",
            "{n} stones may have reached the attention threshold of {t}: their intervals extend to it",
        ],
        joints_reach: [
            "{n} joint may have reached the attention threshold of {t}: its interval extends to it",
            "{n} joints may have reached the attention threshold of {t}: their intervals extend to it",
        ],
        stones_or_joints_reach: [
            "{n} stone or joint may have reached the attention threshold of {t}: its interval extends to it",
            "{n} stones or joints may have reached the attention threshold of {t}: their intervals extend to it",
        ],
        below: [
            "the {n} measured stone does not reach the attention threshold of {t}",
            "none of the {n} measured stones reaches the attention threshold of {t}",
        ],
        below_with_joints: [
            "neither the {n} measured stone nor a joint reaches the attention threshold of {t}",
            "none of the {n} measured stones and no joint reaches the attention threshold of {t}",
        ],
        none_shown: "no motion is shown",
        not_measured: [
            "{n} of {m} stones was not measured",
            "{n} of {m} stones were not measured",
        ],
        deformed_reaches: [
            "the deformation of {n} zone may have reached the attention threshold of {t}",
            "the deformations of {n} zones may have reached the attention threshold of {t}",
        ],
        deformed: [
            "the wall changed its shape in {n} zone",
            "the wall changed its shape in {n} zones",
        ],
        shape: [
            "a zone of {size} bulged by {length} mm against {against} (95 % interval {low} to {high} mm)",
            "a zone of {size} leaned by {length} mm against {against} (95 % interval {low} to {high} mm)",
            "a zone of {size} settled by {length} mm against {against} (95 % interval {low} to {high} mm)",
            "a zone of {size} shifted as a whole by {length} mm against {against} (95 % interval {low} to {high} mm)",
            "a zone of {size} moved by {length} mm against {against} (95 % interval {low} to {high} mm)",
        ],
        pressed_in: "a zone of {size} was pressed in by {length} mm against {against} (95 % interval {low} to {high} mm)",
        diameter: "{diameter} m in diameter",
        sides: "{length} x {width} m",
        against: ["the rest of the wall", "the rest of its part of the wall"],
        shape_kept: "no change of the shape of the wall is shown",
        shape_kept_within: "no change of the shape of the wall is shown (detection limits for a zone of {extent} m: {out} mm out of the wall, {in_face} mm in its face)",
        limit: "detection limit: {median} mm (median)",
        limit_common: "detection limit against the common motion: {median} mm (median)",
        or: "or",
        quantities: [
            "motion",
            "out of the wall",
            "up",
            "along the wall",
            "against neighbours",
            "joint opening",
            "deformation",
            "velocity",
            "departure from the model",
        ],
        elsewhere: "rest of the wall",
    },
    page: PageTexts {
        kind: "Deformation report, stone by stone",
        epochs: "Epochs",
        date: "Date",
        conditions: "Conditions",
        reference: "reference",
        operator: "Operator",
        instruments: "Instruments",
        reference_number: "Reference number",
        not_measured: "What was not measured",
        all_measured: "Every stone of the first epoch was measured.",
        of_not_measured: [
            "{n} of {m} stones was not measured: its motion is unknown, not zero.",
            "{n} of {m} stones were not measured: their motions are unknown, not zero.",
        ],
        next: [
            "Next: see whether the detection limit is small enough for your question.",
            "Next: look at every stone and zone that is named below. Are the outlines right, do the photos of both epochs show the \
                same face, does M3C2 show the motion, too? Correct what is wrong and run again; inspect the rest on site.",
            "Next: mend what the warnings name; <code>stonewise explain CODE</code> says how.",
        ],
        no_thresholds: "No thresholds are set: any motion that is shown calls for attention.",
        look_first: "What to look at first",
        nothing_first: "No stone calls for a closer look.",
        look_at_doubt: "What puts the results in doubt. Until that is mended, no stone can be named.",
        none_stands_out: "No stone stands out; that does not mean that none moved.",
        stone: "Stone",
        along_up: "{along} m along, {up} m up",
        lost_stone: "lost",
        moved_stone: "moved {length} mm (95 %: {low} to {high} mm)",
        moved_stone_common: "moved {length} mm against the common motion (95 %: {low} to {high} mm)",
        loose_stone: "loose: {length} mm against its neighbours (95 %: {low} to {high} mm)",
        opened_joint: "Joint between stones {a} and {b}: opened {length} mm (95 %: {low} to {high} mm)",
        zones: "Zones",
        zone: "Zone",
        state: "State",
        stones: "Stones",
        measured: "Measured",
        moved: "Moved",
        largest: "Largest motion mm",
        assessor: "Assessed by",
        signature: "Signature",
        signed: "signed in the studio, results {digest}",
        signed_others: "{who} signed other results on {day}; this signature does not hold for these.",
        remarks: "Remarks",
        wall: "Wall",
        place_date: "Place and date",
        tile_measured: "of {m} stones measured",
        tile_moved: "moved (false discovery rate 5\u{a0}%)",
        tile_moved_common: "moved against the common motion (false discovery rate 5\u{a0}%)",
        tile_loose: "loose: motion unlike the neighbours'",
        tile_largest: "largest motion of a stone that moved",
        tile_largest_common: "largest motion against the common motion",
        tile_no_motion: "no motion is shown",
        tile_cannot_tell: "which stones moved or are loose cannot be told",
        limit_unknown: "Detection limit: cannot be stated for results in doubt",
        registration_included: "Registration error between the surveys is included in the limits: {note}.",
        registration_in_doubt: "Registration error between the surveys: {note}.",
        registration_unknown: "Registration error between the surveys is unknown and is <b>not</b> included in the limits below: limits, \
            intervals and significance hold for motions against the common rigid motion of the measured stones. A motion of the wall \
            as a whole cannot be told from an error of the registration; stable areas outside the wall would show it.",
        registration_unknown_in_doubt: "Registration error between the surveys is unknown, too: a motion of the wall as a whole cannot be told \
            from it; stable areas outside the wall would show it.",
        chance: "Stones above their own 95 % limit: {above}; on a still wall chance alone gives about {chance}. Stones that moved, \
            at a false discovery rate of 5 %: {n}.",
        doubts: "These results must not be relied on as they stand.",
        in_numbers: "In numbers",
        as_computed: "All numbers below are as computed, and must not be relied on.",
        summary: "Summary",
        finished: "finished",
        map_title: "Length of the motion, with in-plane arrows",
        map_colours: "Colours: 0 to {end} mm. ",
        map_note: "Arrows: in-plane part of motions above the stone's own limit, thinned where they would touch. Pale: below its limit; hatched: \
            not measured.",
        map_note_in_doubt: "Arrows: in-plane part of the motions as computed, thinned where they would touch. Hatched: not measured.",
        map_as_measured: " Motions are drawn as measured: with the common motion of the wall, which may be an error of the registration.",
        map_zones: " Dark outlines: areas that changed their shape.",
        section_title: "Stone {id} before and after",
        section_note: [
            "Points of both epochs in a horizontal section through its middle, seen from above",
            "Points of both epochs in a vertical section through its middle, seen from the side",
        ],
        section_place: "from the middle of the stone (m)",
        section_out: "out of the wall (mm)",
        no_registration: "Nothing is recorded about the registration of the epochs.",
    },
    sections: SectionTexts::ENGLISH,
    stones: StoneTexts::ENGLISH,
    maps: MapTexts::ENGLISH,
    charts: ChartTexts::ENGLISH,
    checks: CheckTexts::ENGLISH,
    influence: InfluenceTexts::ENGLISH,
    scores: ScoreTexts::ENGLISH,
    method: MethodTexts::ENGLISH,
    audit: AuditTexts::ENGLISH,
    series: &series::ENGLISH,
    instruments: &instruments::ENGLISH,
    yearly: &yearly::ENGLISH,
    statuses: [
        "measured",
        "the later epoch has no points, or no photo of them, at this place",
        "the later epoch shows the place, but no stone was found there",
        "several stones of the later epoch fit equally well",
        "the best candidate's face is much larger or smaller: masks merged or split",
        "no stone of the wall: fields of one relief that stand back from it, as of a door or a shutter",
        "too few points for an estimate",
        "the estimate did not settle",
        "the two epochs do not show the same surface, or nothing confirms a motion unlike the rest of the wall",
        "the surface is too flat to show the motion",
    ],
    terms: [
        "the stone itself and its neighbours",
        "errors shared by points of stones",
        "poses of tracked photos",
        "interior orientation of photos",
        "scale of the epochs",
        "registration of the epochs",
        "common motion",
    ],
};

static GERMAN: Texts = Texts {
    tag: "de",
    decimal: ",",
    states: States {
        fine: "Normal",
        attention: "Aufmerksamkeit",
        alarm: "Alarm",
        cannot_tell: "Keine Aussage m\u{f6}glich",
    },
    clauses: Clauses {
        not_converged: "die Ausgleichung ist nicht konvergiert, auf ihre Bewegungen und Intervalle ist kein Verlass",
        in_doubt: "die Ergebnisse als Ganzes sind zweifelhaft, auf sie ist kein Verlass",
        apparent: [
            "wie berechnet l\u{e4}ge {n} Stein \u{fc}ber der Alarmschwelle",
            "wie berechnet l\u{e4}gen {n} Steine \u{fc}ber der Alarmschwelle",
        ],
        beyond: [
            [
                "{n} Stein hat sich \u{fc}ber die {level} von {t} hinaus bewegt",
                "{n} Steine haben sich \u{fc}ber die {level} von {t} hinaus bewegt",
            ],
            [
                "{n} Stein hat sich gegen seine Nachbarn \u{fc}ber die {level} von {t} hinaus bewegt",
                "{n} Steine haben sich gegen ihre Nachbarn \u{fc}ber die {level} von {t} hinaus bewegt",
            ],
            [
                "{n} Fuge hat sich \u{fc}ber die {level} von {t} hinaus ge\u{f6}ffnet",
                "{n} Fugen haben sich \u{fc}ber die {level} von {t} hinaus ge\u{f6}ffnet",
            ],
            [
                "{n} Zone hat sich \u{fc}ber die {level} von {t} hinaus verformt",
                "{n} Zonen haben sich \u{fc}ber die {level} von {t} hinaus verformt",
            ],
            [
                "{n} Stein bewegt sich schneller als die {level} von {t}",
                "{n} Steine bewegen sich schneller als die {level} von {t}",
            ],
            [
                "{n} Stein weicht \u{fc}ber die {level} von {t} hinaus von der Vorhersage der Reihe ab",
                "{n} Steine weichen \u{fc}ber die {level} von {t} hinaus von der Vorhersage der Reihe ab",
            ],
        ],
        levels: ["Aufmerksamkeitsschwelle", "Alarmschwelle"],
        rate_not_judged: "Geschwindigkeiten sind nicht mit ihren Schwellen vergleichbar: es fehlen die Daten beider Epochen oder, in einer Reihe, von dreien",
        departure_not_judged: "Abweichungen vom Modell sind nicht mit ihren Schwellen vergleichbar: ein Modell braucht vier Epochen mit Datum",
        mm_a_year: "mm im Jahr",
        standard_deviations: "Standardabweichungen",
        moved: [
            "{n} von {m} gemessenen Steinen hat sich bewegt",
            "{n} von {m} gemessenen Steinen haben sich bewegt",
        ],
        moved_common: [
            "{n} von {m} gemessenen Steinen hat sich gegen die gemeinsame Bewegung der Mauer bewegt",
            "{n} von {m} gemessenen Steinen haben sich gegen die gemeinsame Bewegung der Mauer bewegt",
        ],
        loose: [
            "{n} Stein ist lose: er hat sich anders bewegt als seine Nachbarn",
            "{n} Steine sind lose: sie haben sich anders bewegt als ihre Nachbarn",
        ],
        lost: [
            "{n} Stein fehlt: die sp\u{e4}tere Epoche zeigt seinen Platz ohne ihn",
            "{n} Steine fehlen: die sp\u{e4}tere Epoche zeigt ihre Pl\u{e4}tze ohne sie",
        ],
        largest: "die gr\u{f6}\u{df}te Bewegung betr\u{e4}gt {length} mm (95-%-Intervall {low} bis {high} mm), Stein {id}",
        largest_common: "die gr\u{f6}\u{df}te Bewegung gegen die gemeinsame Bewegung der Mauer betr\u{e4}gt {length} mm (95-%-Intervall {low} bis {high} mm), Stein {id}",
        largest_of_these: "die gr\u{f6}\u{df}te dieser Bewegungen betr\u{e4}gt {length} mm (95-%-Intervall {low} bis {high} mm), Stein {id}",
        nothing_measured: "kein Stein wurde gemessen",
        few_measured: [
            "nur {n} von {m} Steinen wurde gemessen",
            "nur {n} von {m} Steinen wurden gemessen",
        ],
        datum_unknown: "der Registrierungsfehler zwischen den Aufnahmen ist unbekannt, eine Bewegung der Mauer als Ganzes w\u{e4}re nicht zu sehen",
        none_against_common: "kein Stein hat sich gegen die gemeinsame Bewegung der Mauer bewegt",
        reaches: [
            "{n} Stein kann die Aufmerksamkeitsschwelle von {t} erreicht haben: sein Intervall reicht bis zu ihr",
            "{n} Steine k\u{f6}nnen die Aufmerksamkeitsschwelle von {t} erreicht haben: ihre Intervalle reichen bis zu ihr",
        ],
        joints_reach: [
            "{n} Fuge kann die Aufmerksamkeitsschwelle von {t} erreicht haben: ihr Intervall reicht bis zu ihr",
            "{n} Fugen k\u{f6}nnen die Aufmerksamkeitsschwelle von {t} erreicht haben: ihre Intervalle reichen bis zu ihr",
        ],
        stones_or_joints_reach: [
            "{n} Stein oder Fuge kann die Aufmerksamkeitsschwelle von {t} erreicht haben: das Intervall reicht bis zu ihr",
            "{n} Steine oder Fugen k\u{f6}nnen die Aufmerksamkeitsschwelle von {t} erreicht haben: ihre Intervalle reichen bis zu ihr",
        ],
        below: [
            "der {n} gemessene Stein erreicht die Aufmerksamkeitsschwelle von {t} nicht",
            "keiner der {n} gemessenen Steine erreicht die Aufmerksamkeitsschwelle von {t}",
        ],
        below_with_joints: [
            "weder der {n} gemessene Stein noch eine Fuge erreicht die Aufmerksamkeitsschwelle von {t}",
            "keiner der {n} gemessenen Steine und keine Fuge erreicht die Aufmerksamkeitsschwelle von {t}",
        ],
        none_shown: "keine Bewegung ist nachweisbar",
        not_measured: [
            "{n} von {m} Steinen wurde nicht gemessen",
            "{n} von {m} Steinen wurden nicht gemessen",
        ],
        deformed_reaches: [
            "die Verformung von {n} Zone kann die Aufmerksamkeitsschwelle von {t} erreicht haben",
            "die Verformungen von {n} Zonen k\u{f6}nnen die Aufmerksamkeitsschwelle von {t} erreicht haben",
        ],
        deformed: [
            "die Mauer hat in {n} Zone ihre Form ge\u{e4}ndert",
            "die Mauer hat in {n} Zonen ihre Form ge\u{e4}ndert",
        ],
        shape: [
            "eine Zone von {size} hat sich gegen\u{fc}ber {against} um {length} mm ausgebaucht (95-%-Intervall {low} bis {high} mm)",
            "eine Zone von {size} hat sich gegen\u{fc}ber {against} um {length} mm geneigt (95-%-Intervall {low} bis {high} mm)",
            "eine Zone von {size} hat sich gegen\u{fc}ber {against} um {length} mm gesetzt (95-%-Intervall {low} bis {high} mm)",
            "eine Zone von {size} hat sich gegen\u{fc}ber {against} um {length} mm als Ganzes versetzt (95-%-Intervall {low} bis {high} mm)",
            "eine Zone von {size} hat sich gegen\u{fc}ber {against} um {length} mm bewegt (95-%-Intervall {low} bis {high} mm)",
        ],
        pressed_in: "eine Zone von {size} hat sich gegen\u{fc}ber {against} um {length} mm eingedr\u{fc}ckt (95-%-Intervall {low} bis {high} mm)",
        diameter: "{diameter} m Durchmesser",
        sides: "{length} x {width} m",
        against: ["der \u{fc}brigen Mauer", "dem \u{fc}brigen Teil der Mauer"],
        shape_kept: "keine Form\u{e4}nderung der Mauer ist nachweisbar",
        shape_kept_within: "keine Form\u{e4}nderung der Mauer ist nachweisbar (Nachweisgrenzen f\u{fc}r einen Bereich von {extent} m: {out} mm quer zur Mauer, {in_face} mm in der Mauerfl\u{e4}che)",
        limit: "Nachweisgrenze: {median} mm (Median)",
        limit_common: "Nachweisgrenze gegen die gemeinsame Bewegung: {median} mm (Median)",
        or: "oder",
        quantities: [
            "Bewegung",
            "aus der Mauer",
            "nach oben",
            "entlang der Mauer",
            "gegen Nachbarn",
            "Fugen\u{f6}ffnung",
            "Verformung",
            "Geschwindigkeit",
            "Abweichung vom Modell",
        ],
        elsewhere: "\u{fc}brige Mauer",
    },
    page: PageTexts {
        kind: "Verformungsbericht, Stein f\u{fc}r Stein",
        epochs: "Epochen",
        date: "Datum",
        conditions: "Bedingungen",
        reference: "Bezug",
        operator: "Ausf\u{fc}hrende Stelle",
        instruments: "Instrumente",
        reference_number: "Aktenzeichen",
        not_measured: "Was nicht gemessen wurde",
        all_measured: "Alle Steine der ersten Epoche wurden gemessen.",
        of_not_measured: [
            "{n} von {m} Steinen wurde nicht gemessen: seine Bewegung ist unbekannt, nicht null.",
            "{n} von {m} Steinen wurden nicht gemessen: ihre Bewegungen sind unbekannt, nicht null.",
        ],
        next: [
            "N\u{e4}chster Schritt: pr\u{fc}fen, ob die Nachweisgrenze f\u{fc}r die Fragestellung klein genug ist.",
            "N\u{e4}chster Schritt: jeden unten genannten Stein und jede Zone ansehen. Stimmen die Umrisse, zeigen die Fotos beider Epochen \
                dieselbe Fl\u{e4}che, zeigt auch M3C2 die Bewegung? Was falsch ist, berichtigen und neu rechnen; den Rest vor Ort pr\u{fc}fen.",
            "N\u{e4}chster Schritt: beheben, was die Warnungen nennen; <code>stonewise explain CODE</code> sagt, wie.",
        ],
        no_thresholds: "Es sind keine Schwellen gesetzt: jede nachweisbare Bewegung verlangt Aufmerksamkeit.",
        look_first: "Was zuerst anzusehen ist",
        nothing_first: "Kein Stein muss genauer angesehen werden.",
        look_at_doubt: "Was die Ergebnisse zweifelhaft macht. Solange das nicht behoben ist, kann kein Stein genannt werden.",
        none_stands_out: "Kein Stein f\u{e4}llt auf; das hei\u{df}t nicht, dass sich keiner bewegt hat.",
        stone: "Stein",
        along_up: "{along} m l\u{e4}ngs, {up} m hoch",
        lost_stone: "fehlt",
        moved_stone: "hat sich um {length} mm bewegt (95 %: {low} bis {high} mm)",
        moved_stone_common: "{length} mm gegen die gemeinsame Bewegung (95 %: {low} bis {high} mm)",
        loose_stone: "lose: {length} mm gegen seine Nachbarn (95 %: {low} bis {high} mm)",
        opened_joint: "Fuge zwischen den Steinen {a} und {b}: um {length} mm ge\u{f6}ffnet (95 %: {low} bis {high} mm)",
        zones: "Zonen",
        zone: "Zone",
        state: "Zustand",
        stones: "Steine",
        measured: "Gemessen",
        moved: "Bewegt",
        largest: "Gr\u{f6}\u{df}te Bewegung mm",
        assessor: "Beurteilt durch",
        signature: "Unterschrift",
        signed: "im Studio unterzeichnet, Ergebnisse {digest}",
        signed_others: "{who} hat am {day} andere Ergebnisse unterzeichnet; f\u{fc}r diese gilt die Unterschrift nicht.",
        remarks: "Bemerkungen",
        wall: "Mauer",
        place_date: "Ort und Datum",
        tile_measured: "von {m} Steinen gemessen",
        tile_moved: "bewegt (Falscherkennungsrate 5\u{a0}%)",
        tile_moved_common: "gegen die gemeinsame Bewegung bewegt (Falscherkennungsrate 5\u{a0}%)",
        tile_loose: "lose: Bewegung anders als die der Nachbarn",
        tile_largest: "gr\u{f6}\u{df}te Bewegung eines bewegten Steins",
        tile_largest_common: "gr\u{f6}\u{df}te Bewegung gegen die gemeinsame Bewegung",
        tile_no_motion: "keine Bewegung ist nachweisbar",
        tile_cannot_tell: "welche Steine sich bewegt haben oder lose sind, ist nicht zu sagen",
        limit_unknown: "Nachweisgrenze: bei zweifelhaften Ergebnissen nicht anzugeben",
        registration_included: "Der Registrierungsfehler zwischen den Aufnahmen ist in den Grenzen enthalten: {note}.",
        registration_in_doubt: "Registrierungsfehler zwischen den Aufnahmen: {note}.",
        registration_unknown: "Der Registrierungsfehler zwischen den Aufnahmen ist unbekannt und in den Grenzen unten <b>nicht</b> enthalten: \
            Grenzen, Intervalle und Signifikanz gelten f\u{fc}r Bewegungen gegen die gemeinsame starre Bewegung der gemessenen Steine. Eine Bewegung \
            der Mauer als Ganzes ist von einem Registrierungsfehler nicht zu unterscheiden; stabile Fl\u{e4}chen neben der Mauer w\u{fc}rden sie zeigen.",
        registration_unknown_in_doubt: "Auch der Registrierungsfehler zwischen den Aufnahmen ist unbekannt: eine Bewegung der Mauer als Ganzes ist \
            von ihm nicht zu unterscheiden; stabile Fl\u{e4}chen neben der Mauer w\u{fc}rden sie zeigen.",
        chance: "Steine \u{fc}ber ihrer eigenen 95-%-Grenze: {above}; bei einer ruhenden Mauer w\u{e4}ren es durch Zufall etwa {chance}. Bewegte Steine, \
            bei einer Falscherkennungsrate von 5 %: {n}.",
        doubts: "Auf diese Ergebnisse ist so kein Verlass.",
        in_numbers: "In Zahlen",
        as_computed: "Alle Zahlen unten sind wie berechnet; auf sie ist kein Verlass.",
        summary: "Zusammenfassung",
        finished: "berechnet",
        map_title: "Betrag der Bewegung, mit Pfeilen in der Ebene der Mauer",
        map_colours: "Farben: 0 bis {end} mm. ",
        map_note_in_doubt: "Pfeile: Anteil der berechneten Bewegungen in der Ebene, ausged\u{fc}nnt, wo sie sich ber\u{fc}hren w\u{fc}rden. \
            Schraffiert: nicht gemessen.",
        map_note: "Pfeile: Anteil in der Ebene von Bewegungen \u{fc}ber der eigenen Grenze des Steins, ausged\u{fc}nnt, wo sie sich ber\u{fc}hren \
            w\u{fc}rden. Blass: unter der Grenze; schraffiert: nicht gemessen.",
        map_as_measured: " Die Bewegungen sind gezeichnet wie gemessen: mit der gemeinsamen Bewegung der Mauer, die ein Registrierungsfehler sein kann.",
        map_zones: " Dunkel umrandet: Bereiche, die ihre Form ge\u{e4}ndert haben.",
        section_title: "Stein {id} vorher und nachher",
        section_note: [
            "Punkte beider Epochen in einem waagrechten Schnitt durch seine Mitte, von oben gesehen",
            "Punkte beider Epochen in einem lotrechten Schnitt durch seine Mitte, von der Seite gesehen",
        ],
        section_place: "von der Mitte des Steins (m)",
        section_out: "aus der Mauer (mm)",
        no_registration: "\u{dc}ber die Registrierung der Epochen ist nichts festgehalten.",
    },
    sections: SectionTexts::GERMAN,
    stones: StoneTexts::GERMAN,
    maps: MapTexts::GERMAN,
    charts: ChartTexts::GERMAN,
    checks: CheckTexts::GERMAN,
    influence: InfluenceTexts::GERMAN,
    scores: ScoreTexts::GERMAN,
    method: MethodTexts::GERMAN,
    audit: AuditTexts::GERMAN,
    series: &series::GERMAN,
    instruments: &instruments::GERMAN,
    yearly: &yearly::GERMAN,
    statuses: [
        "gemessen",
        "die sp\u{e4}tere Epoche hat an dieser Stelle keine Punkte oder kein Foto von ihnen",
        "die sp\u{e4}tere Epoche zeigt die Stelle, aber dort wurde kein Stein gefunden",
        "mehrere Steine der sp\u{e4}teren Epoche passen gleich gut",
        "die Fl\u{e4}che des besten Kandidaten ist viel gr\u{f6}\u{df}er oder kleiner: Masken verschmolzen oder geteilt",
        "kein Stein der Mauer: Felder mit gleichem Relief, die hinter ihr liegen, wie die einer T\u{fc}r oder eines Ladens",
        "zu wenige Punkte f\u{fc}r eine Sch\u{e4}tzung",
        "die Sch\u{e4}tzung ist nicht zur Ruhe gekommen",
        "die beiden Epochen zeigen nicht dieselbe Oberfl\u{e4}che, oder nichts best\u{e4}tigt eine Bewegung, die der \u{fc}brigen Mauer widerspricht",
        "die Oberfl\u{e4}che ist zu eben, um die Bewegung zu zeigen",
    ],
    terms: [
        "der Stein selbst und seine Nachbarn",
        "gemeinsame Fehler der Punkte von Steinen",
        "Posen verfolgter Fotos",
        "innere Orientierung der Fotos",
        "Ma\u{df}stab der Epochen",
        "Registrierung der Epochen",
        "gemeinsame Bewegung",
    ],
};

/// Usual conditions of an epoch, English and German.
static CONDITIONS: [(&str, &str); 14] = [
    ("temperature", "Temperatur"),
    ("air temperature", "Lufttemperatur"),
    ("water temperature", "Wassertemperatur"),
    ("wall temperature", "Mauertemperatur"),
    ("reservoir level", "Stauspiegel"),
    ("water level", "Wasserstand"),
    ("tailwater level", "Unterwasserstand"),
    ("seepage", "Sickerwasser"),
    ("humidity", "Luftfeuchte"),
    ("pressure", "Luftdruck"),
    ("wind", "Wind"),
    ("wind speed", "Windgeschwindigkeit"),
    ("rain", "Niederschlag"),
    ("snow", "Schneeh\u{f6}he"),
];

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
        match language {
            Language::English => &ENGLISH,
            Language::German => &GERMAN,
        }
    }

    /// The language.
    pub(crate) fn language(&self) -> Language {
        match self.tag {
            "de" => Language::German,
            _ => Language::English,
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
        let known = CONDITIONS
            .iter()
            .find(|(english, _)| *english == words.to_lowercase());
        match (self.language(), known) {
            (Language::German, Some((_, german))) => (*german).to_owned(),
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

/// The text for this number of things, with `{n}` filled in.
pub(crate) fn counted(texts: Number, n: usize, values: &[(&str, &str)]) -> String {
    let text = fill(texts[usize::from(n != 1)], &[("n", &count(n))]);
    fill(&text, values)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every brace of a text, in order.
    fn braces(text: &str) -> Vec<String> {
        let mut all: Vec<String> = text
            .split('{')
            .skip(1)
            .filter_map(|t| Some(t.split_once('}')?.0.to_owned()))
            .collect();
        all.sort();
        all
    }

    #[test]
    fn both_languages_fill_in_the_same_values() {
        // The strings of both tables in their order, as they are printed for debugging.
        let strings = |texts: &Texts| {
            // Debugging writes a space that does not break with braces.
            let text = format!("{texts:?}").replace("\\u{a0}", " ");
            text.split('"')
                .skip(1)
                .step_by(2)
                .map(str::to_owned)
                .collect::<Vec<_>>()
        };
        let (english, german) = (strings(&ENGLISH), strings(&GERMAN));
        assert_eq!(english.len(), german.len());
        for (e, g) in english.iter().zip(&german) {
            // What a run says in English is said anew in other languages.
            if e != "{note}" {
                assert_eq!(braces(e), braces(g), "{e} / {g}");
            }
        }
    }

    #[test]
    fn outcomes_are_those_of_the_tables() {
        for (i, status) in Status::ALL.into_iter().enumerate() {
            assert_eq!((status as usize, ENGLISH.status(status)), (i, status.meaning()));
        }
    }

    #[test]
    fn one_and_many_are_told_apart() {
        let clauses = &Texts::of(Language::English).clauses;
        assert_eq!(
            counted(
                clauses.beyond(Quantity::Joints),
                1,
                &[("t", "5 mm"), ("level", clauses.levels[1])]
            ),
            "1 joint opened beyond the alarm threshold of 5 mm"
        );
        assert!(counted(clauses.lost, 2, &[]).starts_with("2 stones are lost"));
        assert_eq!(Texts::of(Language::German).mm(0.000_24), "0,24");
        assert_eq!(Texts::of(Language::German).threshold(2.5), "2,5");
        assert_eq!(ENGLISH.threshold(10.0), "10");
    }
}
