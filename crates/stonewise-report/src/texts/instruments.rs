//! Texts about other instruments.

/// What the section on other instruments is made of.
#[derive(Debug)]
pub(crate) struct InstrumentTexts {
    pub heading: &'static str,
    pub intro: &'static str,
    pub together: &'static str,
    /// Name, instrument, stones around it, difference, agreement.
    pub columns: [&'static str; 5],
    /// It agrees, it does not, cannot tell.
    pub words: [&'static str; 3],
    /// Observed, undetermined, contradicted.
    pub uses: [&'static str; 3],
    pub not_compared: &'static str,
    pub no_date: &'static str,
    pub before: &'static str,
    pub after: &'static str,
    pub gap: &'static str,
    pub no_stones: &'static str,
}

pub(super) static ENGLISH: InstrumentTexts = InstrumentTexts {
    heading: "Other instruments",
    intro: "Motion since the reference along x / y / z, mm. Stones: mean of the nearest ones. Difference: stones less instrument, with the 95 % interval of both and of the registration where it is known; where it is not, less what the other instruments say of it.",
    together: "All of them together: chance makes differences this large with a probability of {p}.",
    columns: [
        "Instrument",
        "measured",
        "Stones around it",
        "Difference",
        "Agree?",
    ],
    words: ["yes", "no", "cannot tell"],
    uses: [
        "The instruments in use are observations of the datum: they are in the motions of this report, not in the table.",
        "The instruments in use do not determine the datum and are not used.",
        "The instruments in use contradict each other or the datum and are not used.",
    ],
    not_compared: "Not compared: {list}.",
    no_date: "an epoch has no date",
    before: "no reading before the reference or the epoch",
    after: "no reading after the reference or the epoch",
    gap: "readings {days} days apart",
    no_stones: "no measured stone within {reach} m",
};

pub(super) static GERMAN: InstrumentTexts = InstrumentTexts {
    heading: "Andere Messeinrichtungen",
    intro: "Bewegung seit der Bezugsepoche l\u{e4}ngs x / y / z, mm. Steine: Mittel der n\u{e4}chsten. Differenz: Steine minus Messeinrichtung mit dem 95-%-Intervall von beiden und der Registrierung, wo sie bekannt ist; wo nicht, abz\u{fc}glich dessen, was die anderen Messeinrichtungen dazu sagen.",
    together: "Alle zusammen: so gro\u{df}e Differenzen entstehen zuf\u{e4}llig mit der Wahrscheinlichkeit {p}.",
    columns: [
        "Messeinrichtung",
        "gemessen",
        "Steine um sie",
        "Differenz",
        "Einklang?",
    ],
    words: ["ja", "nein", "keine Aussage"],
    uses: [
        "Die verwendeten Messeinrichtungen sind Beobachtungen des Datums: sie stecken in den Bewegungen dieses Berichts, nicht in der Tabelle.",
        "Die verwendeten Messeinrichtungen bestimmen das Datum nicht und sind nicht verwendet.",
        "Die verwendeten Messeinrichtungen widersprechen einander oder dem Datum und sind nicht verwendet.",
    ],
    not_compared: "Nicht verglichen: {list}.",
    no_date: "eine Epoche hat kein Datum",
    before: "keine Ablesung vor der Bezugsepoche oder der Epoche",
    after: "keine Ablesung nach der Bezugsepoche oder der Epoche",
    gap: "Ablesungen {days} Tage auseinander",
    no_stones: "kein gemessener Stein innerhalb von {reach} m",
};
