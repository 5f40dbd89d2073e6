//! The texts of the report behind its first page, both languages of each beside each other.

/// Declares a group of texts: a name, the English and the German text of each. None can be without the other.
macro_rules! in_both {
    ($(#[$doc:meta])* $name:ident { $($field:ident: $english:expr, $german:expr;)* }) => {
        $(#[$doc])*
        #[derive(Debug)]
        pub(crate) struct $name {
            $(pub $field: &'static str,)*
        }

        impl $name {
            pub const ENGLISH: Self = Self { $($field: $english,)* };
            pub const GERMAN: Self = Self { $($field: $german,)* };
        }
    };
}

in_both! {
    /// Names of sections, in the bar that leads to them and as headings.
    SectionTexts {
        maps: "Maps", "Karten";
        tables: "Stones", "Steine";
        distributions: "Distributions", "Verteilungen";
        datum: "Datum", "Geodätisches Datum";
        datum_title: "Datum check", "Prüfung des geodätischen Datums";
        evaluation: "Known motion", "Bekannte Bewegung";
        evaluation_title: "Known motion: how accurate the results are", "Bekannte Bewegung: wie genau die Ergebnisse sind";
        method: "Method", "Verfahren";
        method_title: "Method, terms and limits", "Verfahren, Begriffe und Grenzen";
        audit: "Audit", "Nachweise";
        title_end: "stone by stone", "Stein für Stein";
        survey: "Survey", "Aufnahme";
        epoch: "epoch {n}", "Epoche {n}";
    }
}

in_both! {
    /// The summary in numbers, and the tables of stones.
    StoneTexts {
        median: "Median of all measured stones: <b>{along}</b> mm along the wall, <b>{up}</b> mm up, <b>{out}</b> mm out of the wall.",
            "Median aller gemessenen Steine: <b>{along}</b> mm längs der Mauer, <b>{up}</b> mm aufwärts, <b>{out}</b> mm aus der Mauer.";
        none_loose: "No stone is loose: none moves unlike its neighbours beyond what the noise explains.",
            "Kein Stein ist lose: keiner weicht stärker von seinen Nachbarn ab, als das Rauschen erklärt.";
        one_loose: "<b>One stone is loose</b>: it moves unlike its neighbours; it is listed below.",
            "<b>Ein Stein ist lose</b>: er bewegt sich anders als seine Nachbarn; er ist unten aufgeführt.";
        some_loose: "<b>{n} stones are loose</b>: they move unlike their neighbours; they are listed below.",
            "<b>{n} Steine sind lose</b>: sie bewegen sich anders als ihre Nachbarn; sie sind unten aufgeführt.";
        between: "between {a0} and {a1} m along the wall and {u0} and {u1} m up the face",
            "zwischen {a0} und {a1} m längs der Mauer und {u0} und {u1} m auf der Mauerfläche";
        all_over: "Stones that moved are found all over the measured wall.", "Bewegte Steine finden sich auf der ganzen gemessenen Mauer.";
        nine_tenths: "Nine tenths of the stones that moved lie {where}.", "Neun Zehntel der bewegten Steine liegen {where}.";
        largest_tenth: "The largest tenth of their motions, {least} mm and more, lies {where}.",
            "Das größte Zehntel ihrer Bewegungen, {least} mm und mehr, liegt {where}.";
        outcomes: "Outcomes", "Ergebnis je Stein";
        status: "status", "Status";
        meaning: "meaning", "Bedeutung";
        stones: "stones", "Steine";
        share: "share", "Anteil";
        largest: "Largest motions of stones that moved", "Größte Bewegungen bewegter Steine";
        loose_stones: "Loose stones", "Lose Steine";
        by_reason: "Stones that were not measured, by reason", "Nicht gemessene Steine, nach Grund";
        stone: "stone", "Stein";
        along: "along m", "längs m";
        up: "up m", "hoch m";
        d_along: "d along mm", "d längs mm";
        d_up: "d up mm", "d auf mm";
        d_out: "d out mm", "d aus mm";
        norm: "length mm", "Betrag mm";
        limit: "LoD95 mm", "LoD95 mm";
        neighbours: "against neighbours mm", "gegen Nachbarn mm";
        rotation: "rotation mrad", "Drehung mrad";
        loose: "loose", "lose";
        rest: "{shown} of {n}; all are in stones.csv.", "{shown} von {n}; alle stehen in stones.csv.";
        stretches: "By stretch of the wall (medians)", "Nach Abschnitten der Mauer (Mediane)";
        stretch: "along the wall m", "längs der Mauer m";
        measured: "measured", "gemessen";
        above: "above their limit", "über ihrer Grenze";
    }
}

in_both! {
    /// The maps.
    MapTexts {
        above: "above its own 95 % limit", "über der eigenen 95-%-Grenze";
        below: "below its own limit (faded)", "unter der eigenen Grenze (blass)";
        unmeasured: "not measured", "nicht gemessen";
        loose: "loose", "lose";
        edited: "edited by hand", "von Hand geändert";
        carried: "carried from another epoch", "aus einer anderen Epoche übernommen";
        intro: "The wall seen from the front, unrolled. Components share one scale; millimetres, second epoch minus first.",
            "Die Mauer von vorn, abgewickelt. Die Komponenten teilen eine Skala; Millimeter, zweite Epoche minus erste.";
        beyond: " {n} components exceed the scale and have its end colours.",
            " {n} Komponenten gehen über die Skala hinaus und haben ihre Endfarben.";
        shape: "Deformation", "Verformung";
        shape_note: "Length of the motion less the rigid motion of the part of the wall that kept its shape; nothing of the datum is in it.",
            "Betrag der Bewegung abzüglich der starren Bewegung des Teils der Mauer, der seine Form behielt; das geodätische Datum geht nicht ein.";
        shape_faded: " Pale: outside the zones that changed their shape.", " Blass: außerhalb der Zonen, die ihre Form geändert haben.";
        along: "Along the wall", "Längs der Mauer";
        along_note: "Positive to the right of a viewer who faces the wall.", "Positiv nach rechts für einen Betrachter vor der Mauer.";
        up: "Up the face", "Die Mauerfläche hinauf";
        up_note: "Positive upwards along the batter.", "Positiv aufwärts entlang des Anlaufs.";
        out: "Out of the wall", "Aus der Mauer heraus";
        out_note: "Positive towards the viewer (downstream).", "Positiv auf den Betrachter zu (luftseitig).";
        m3c2: "M3C2 distance, for comparison", "M3C2-Abstand, zum Vergleich";
        m3c2_note: "Core points, along the normal; same scale. Faded: below its LoD95.",
            "Kernpunkte, entlang der Normalen; gleiche Skala. Blass: unter der LoD95.";
        opening: "Joint opening", "Fugenöffnung";
        opening_note: "Motion of neighbouring stones apart, across their joint: red opens, blue closes; a scale of its own.",
            "Bewegung benachbarter Steine auseinander, quer zu ihrer Fuge: rot öffnet, blau schließt; eigene Skala.";
        opening_faded: " Faded: less than its 95 % uncertainty.", " Blass: weniger als die 95-%-Unsicherheit.";
        relative: "Motion against the neighbours", "Bewegung gegen die Nachbarn";
        relative_note: "Length of the difference to what the neighbours predict.", "Betrag des Unterschieds zu dem, was die Nachbarn erwarten lassen.";
        limit: "Detection limit (LoD95)", "Nachweisgrenze (LoD95)";
        limit_note: "What a motion must exceed to be above its 95 % limit; median {median} mm.",
            "Was eine Bewegung überschreiten muss, um über ihrer 95-%-Grenze zu liegen; Median {median} mm.";
        rotation: "Rotation", "Drehung";
        rotation_note: "Angle of the stone's turn.", "Winkel, um den sich der Stein gedreht hat.";
        axis_along: "along the wall (m)", "längs der Mauer (m)";
        axis_up: "up the face (m)", "auf der Mauerfläche (m)";
        axis_up_short: "up (m)", "hoch (m)";
        in_plane: "{length} mm in-plane", "{length} mm in der Ebene";
    }
}

in_both! {
    /// The charts, and the check of the datum.
    ChartTexts {
        along: "along the wall", "längs der Mauer";
        up: "up the face", "die Mauerfläche hinauf";
        out: "out of the wall", "aus der Mauer heraus";
        displacement: "Displacement {direction}", "Verschiebung {direction}";
        cross: " Cross: the known motion.", " Kreuz: die bekannte Bewegung.";
        axis_along: "along (mm)", "längs (mm)";
        axis_up: "up (mm)", "auf (mm)";
        axis_out: "stone, out (mm)", "Stein, heraus (mm)";
        stones_title: "In-plane motion of the stones", "Bewegung der Steine in der Ebene";
        stones: "Stones: {n}.", "Steine: {n}.";
        m3c2_title: "In-plane part of M3C2", "Anteil von M3C2 in der Ebene";
        m3c2: "Core points: {n}; vector = distance times normal.", "Kernpunkte: {n}; Vektor = Abstand mal Normale.";
        out_title: "Out of plane: stones against M3C2", "Aus der Ebene: Steine gegen M3C2";
        out_note: "Stones: {n}; median difference {median} mm, NMAD {nmad} mm.", "Steine: {n}; Median der Unterschiede {median} mm, NMAD {nmad} mm.";
        direction: "direction", "Richtung";
        all_median: "all: median mm", "alle: Median mm";
        all_nmad: "all: NMAD mm", "alle: NMAD mm";
        below_median: "below their limit: median mm", "unter ihrer Grenze: Median mm";
        below_nmad: "below their limit: NMAD mm", "unter ihrer Grenze: NMAD mm";
        datum: "Displacements refer to the registration of the epochs. A motion that all stones share can be a motion of the wall or an \
            error of that registration; only stable points outside the wall can tell.",
            "Verschiebungen beziehen sich auf die Registrierung der Epochen. Eine Bewegung, die alle Steine teilen, kann eine Bewegung der Mauer sein \
            oder ein Fehler dieser Registrierung; nur stabile Punkte neben der Mauer können das zeigen.";
        datum_below: " Stones below their own limit should scatter around zero.", " Steine unter ihrer eigenen Grenze sollten um null streuen.";
        nmad: "NMAD: 1.4826 times the median distance from the median, the standard deviation of normally distributed values. Stones in all: {n}.",
            "NMAD: das 1,4826-Fache des mittleren Abstands (Median) vom Median, bei normalverteilten Werten die Standardabweichung. Steine insgesamt: {n}.";
        nmad_below: " Below their limit: {below}.", " Unter ihrer Grenze: {below}.";
        estimated: "Datum: {note}. Error of the later epoch in the middle of the wall: {parts} (one standard deviation, world axes; {cells} plane cells in stable \
            areas, sources compared on {compared} stones).",
            "Datum: {note}. Fehler der späteren Epoche in der Mitte der Mauer: {parts} (eine Standardabweichung, Achsen des Weltsystems; {cells} ebene Zellen in \
            stabilen Flächen, Quellen verglichen an {compared} Steinen).";
        and: " and ", " und ";
        known: "Datum: {note}.", "Datum: {note}.";
        unknown: "<b>The registration error of the epochs is unknown.</b> The project names no stable areas \
            (<code>[[registration.stable]]</code>) that show it and states no error (<code>epoch_error_m</code>): intervals, limits and \
            significance hold for motions against the common rigid motion of the measured stones, not against the ground.",
            "<b>Der Registrierungsfehler der Epochen ist unbekannt.</b> Das Projekt nennt keine stabilen Flächen \
            (<code>[[registration.stable]]</code>), die ihn zeigen, und gibt keinen Fehler an (<code>epoch_error_m</code>): Intervalle, Grenzen und \
            Signifikanz gelten für Bewegungen gegen die gemeinsame starre Bewegung der gemessenen Steine, nicht gegen den Boden.";
    }
}

in_both! {
    /// The checks of the run.
    CheckTexts {
        heading: "Checks", "Prüfungen";
        intro: "A check that failed puts the results as a whole in doubt.",
            "Eine nicht bestandene Prüfung macht die Ergebnisse als Ganzes zweifelhaft.";
        check: "what is checked", "was geprüft wird";
        epoch: "epoch", "Epoche";
        value: "value", "Wert";
        limit: "limit", "Grenze";
        source: "where the limit is from", "woher die Grenze stammt";
        outcome: "outcome", "Ergebnis";
        at_least: "at least {limit}", "mindestens {limit}";
        at_most: "at most {limit}", "höchstens {limit}";
        passed: "passed", "bestanden";
        failed: "failed", "nicht bestanden";
    }
}

in_both! {
    /// What the results rest on.
    InfluenceTexts {
        heading: "What the results rest on", "Worauf die Ergebnisse beruhen";
        intro: "Smallest blunder: the offset that a test against all others finds (significance level 0.1 %, power 80 %). Largest motion and shift: \
            the length of the largest motion, and the largest change of any motion, without it. A dash: nothing else shows it.",
            "Kleinster Fehler: die Verschiebung, die ein Test gegen alle anderen findet (Signifikanzniveau 0,1 %, Güte 80 %). Größte Bewegung und \
            Änderung: die Länge der größten Bewegung und die größte Änderung irgendeiner Bewegung ohne sie. Ein Strich: nichts anderes zeigt es.";
        name: "source, stable area, instrument or length", "Quelle, stabile Fläche, Instrument oder Länge";
        redundancy: "redundancy", "Redundanz";
        blunder: "smallest blunder mm", "kleinster Fehler mm";
        without: "largest motion without it mm", "größte Bewegung ohne sie mm";
        shift: "shift without it mm", "Änderung ohne sie mm";
    }
}

in_both! {
    /// The score against a known motion.
    ScoreTexts {
        stones: "Stones", "Steine";
        stones_external: "Stones, external truth", "Steine, äußere Wahrheit";
        truth: "Truth: {truth}.", "Wahrheit: {truth}.";
        rmse_title: "RMSE of detected against applied motion", "RMSE der erkannten gegen die aufgebrachte Bewegung";
        rmse_note: "Per axis: along and up pooled, the figure of the paper's Table 2. Zero predictor: the RMSE of an \
            estimator that always answers \u{201c}did not move\u{201d}, the figure to beat.",
            "Je Achse: längs und auf zusammengefasst, die Zahl aus Tabelle 2 der Veröffentlichung. Null-Schätzer: der RMSE eines Verfahrens, das immer \
            \u{201e}hat sich nicht bewegt\u{201c} antwortet; diese Zahl ist zu unterbieten.";
        definitions: "Definitions", "Definitionen";
        along: "along the wall", "längs der Mauer";
        up: "up the face", "die Mauerfläche hinauf";
        per_axis: "in-plane, per axis", "in der Ebene, je Achse";
        in_plane: "in-plane, 2D", "in der Ebene, 2D";
        out: "out of plane", "aus der Ebene";
        space: "3D", "3D";
        method: "method", "Verfahren";
        count: "count", "Anzahl";
        zero: "Zero predictor ({method})", "Null-Schätzer ({method})";
        direction: "direction", "Richtung";
        rmse: "RMSE mm", "RMSE mm";
        mean: "mean mm", "Mittel mm";
        median: "median mm", "Median mm";
        nmad: "NMAD mm", "NMAD mm";
        p95: "95th percentile mm", "95. Perzentil mm";
        outliers: "outliers", "Ausreißer";
        zero_mm: "zero predictor mm", "Null-Schätzer mm";
        covers: "95 % interval covers", "95-%-Intervall enthält";
        estimated: "{method}: {n} of {m} estimated", "{method}: {n} von {m} geschätzt";
        significance: "Significance: {false} of {still} places at rest raised an alarm ({rate}; 5 % is right); {hits} of {detectable} that moved by more than their own limit did ({hit_rate}).",
            "Signifikanz: {false} von {still} ruhenden Stellen gaben Alarm ({rate}; 5 % sind richtig); {hits} von {detectable}, die sich um mehr als ihre Grenze bewegten, taten es ({hit_rate}).";
        chi: " Median of e\u{2032}C<sup>\u{2212}1</sup>e: {chi} (2.37 is right).", " Median von e\u{2032}C<sup>\u{2212}1</sup>e: {chi} (2,37 ist richtig).";
        loose: " Loose stones: {true} true, {reported} reported, {right} right.", " Lose Steine: {true} wahre, {reported} gemeldet, {right} richtig.";
        found: "{n} of {m} countable stones have a displacement ({share}).", "{n} von {m} zählbaren Steinen haben eine Verschiebung ({share}).";
    }
}

in_both! {
    /// Method, terms and limits of the statement, as HTML.
    MethodTexts {
        body: "<p>Stones are outlined in the photos, their labels carried to the points of each epoch's cloud, stones matched across \
        epochs, and the rigid motion of every matched stone estimated from its points.</p>\
        <dl class=\"terms\">\
        <dt>Displacement</dt><dd>Second epoch minus first, of the stone's centroid in the first epoch.</dd>\
        <dt>Along, up, out</dt><dd>The stone's own face frame: horizontal in the face, to the right of a viewer who faces the wall; \
        up along the batter; out of the wall, towards the viewer.</dd>\
        <dt>Above its limit</dt><dd>d\u{2032}C<sup>\u{2212}1</sup>d exceeds 7.81, the 95 % quantile of chi-square with 3 degrees of \
        freedom; C is the covariance of the displacement, registration error included where it is known (see the datum check). A stone at \
        rest exceeds it in 5 % of the cases.</dd>\
        <dt>Moved</dt><dd>Above its limit, and still so when the share of false ones among all stones that are said to have moved is held at 5 % \
        (Benjamini &amp; Hochberg 1995). The verdict and the list of stones to look at count only these.</dd>\
        <dt>LoD95</dt><dd>The length beyond which a displacement of the same direction is above its limit.</dd>\
        <dt>Unlike its neighbours</dt><dd>The stone's motion differs from what its neighbours predict by more than noise explains; \
        false discoveries are controlled over all stones.</dd>\
        <dt>M3C2</dt><dd>Distance between the clouds along the local normal, at core points: those of the first cloud, thinned \
        (Lague, Brodu &amp; Leroux 2013). It cannot see motion within the face.</dd></dl>\
        <h3>Limitations</h3><p>Displacements refer to the registration of the epochs, so a motion common to many stones \u{2013} \
        a shift, a tilt, a slow drift along the wall \u{2013} may be an error of it, however small the limits of single stones are. A \
        stone is taken as rigid. Masks that merge or split stones spoil single rows; such pairs are reported as failed where they \
        are recognised. Values of stones that were not measured are unknown, not zero.</p>",
        "<p>Steine werden in den Fotos umrissen, ihre Nummern auf die Punkte der Wolke jeder Epoche übertragen, Steine über die Epochen hinweg \
        zugeordnet, und aus ihren Punkten wird die starre Bewegung jedes zugeordneten Steins geschätzt.</p>\
        <dl class=\"terms\">\
        <dt>Verschiebung</dt><dd>Zweite Epoche minus erste, des Schwerpunkts, den der Stein in der ersten Epoche hat.</dd>\
        <dt>Längs, auf, aus</dt><dd>Das eigene System der Steinfläche: waagrecht in der Fläche, nach rechts für einen Betrachter vor der Mauer; \
        aufwärts entlang des Anlaufs; aus der Mauer heraus, auf den Betrachter zu.</dd>\
        <dt>Über seiner Grenze</dt><dd>d\u{2032}C<sup>\u{2212}1</sup>d ist größer als 7,81, das 95-%-Quantil von Chi-Quadrat mit 3 Freiheitsgraden; \
        C ist die Kovarianz der Verschiebung, einschließlich des Registrierungsfehlers, wo er bekannt ist (siehe Prüfung des Datums). Ein ruhender \
        Stein überschreitet sie in 5 % der Fälle.</dd>\
        <dt>Bewegt</dt><dd>Über seiner Grenze, auch wenn der Anteil falscher unter allen als bewegt bezeichneten Steinen auf 5 % gehalten wird \
        (Benjamini &amp; Hochberg 1995). Urteil und Liste der anzusehenden Steine zählen nur diese.</dd>\
        <dt>LoD95</dt><dd>Die Länge, ab der eine Verschiebung derselben Richtung über der Grenze liegt (Nachweisgrenze).</dd>\
        <dt>Anders als seine Nachbarn</dt><dd>Die Bewegung des Steins weicht von dem, was die Nachbarn erwarten lassen, stärker ab, als das Rauschen \
        erklärt; die Falscherkennungsrate wird über alle Steine gehalten.</dd>\
        <dt>M3C2</dt><dd>Abstand der Wolken entlang der örtlichen Normalen, an Kernpunkten: den ausgedünnten der ersten Wolke \
        (Lague, Brodu &amp; Leroux 2013). Bewegungen in der Mauerfläche sieht er nicht.</dd></dl>\
        <h3>Grenzen der Aussage</h3><p>Verschiebungen beziehen sich auf die Registrierung der Epochen; eine Bewegung, die viele Steine teilen \u{2013} ein Versatz, \
        eine Kippung, eine langsame Drift längs der Mauer \u{2013}, kann daher ein Fehler von ihr sein, so klein die Grenzen einzelner Steine auch sind. Ein Stein gilt als \
        starr. Masken, die Steine verschmelzen oder teilen, verderben einzelne Zeilen; solche Paare sind als misslungen gemeldet, wo sie zu erkennen \
        sind. Werte nicht gemessener Steine sind unbekannt, nicht null.</p>";
    }
}

in_both! {
    /// Survey data, warnings, decisions, parameters.
    AuditTexts {
        survey: "Survey data", "Aufnahmedaten";
        epoch: "epoch", "Epoche";
        date: "date", "Datum";
        conditions: "conditions", "Bedingungen";
        clouds: "point clouds", "Punktwolken";
        points: "points", "Punkte";
        cameras: "camera file", "Kameradatei";
        views: "none: views of the cloud", "keine: Ansichten der Punktwolke";
        photos: "photos used", "verwendete Fotos";
        masks: "masks", "Masken";
        detector: "none: found by the detector", "keine: vom Detektor gefunden";
        stones: "stones found", "gefundene Steine";
        motion: "known motion put in", "eingebrachte bekannte Bewegung";
        none: "none", "keine";
        local: "the survey's own local frame, metres", "örtliches System der Aufnahme, Meter";
        coordinates: "Coordinates: {frame}.", "Koordinaten: {frame}.";
        no_run: "There is no run.json beside the results.", "Neben den Ergebnissen liegt keine run.json.";
        steps: "Steps, times and memory", "Schritte, Zeiten und Speicher";
        epochs: "Epochs", "Epochen";
        parameters: "Parameters", "Parameter";
        part: "Part of the survey", "Teil der Aufnahme";
        adjustment: "Adjustment of the motions (registration.json)", "Ausgleichung der Bewegungen (registration.json)";
        step: "step", "Schritt";
        seconds: "seconds", "Sekunden";
        processor: "processor seconds", "Prozessorsekunden";
        memory: "highest memory MB", "höchster Speicher MB";
        origin: "origin", "Herkunft";
        resumed: "taken from an earlier run", "aus einem früheren Lauf";
        decision_of: "decision of the majority of the photos", "Entscheidung der Mehrheit der Fotos";
        decisions: "Decisions about mask instances", "Entscheidungen über Maskeninstanzen";
        decision_list: "Merged, split and dropped masks of epoch {e} ({n})", "Verschmolzene, geteilte und verworfene Masken der Epoche {e} ({n})";
        decision_rest: "{shown} of {n}; all are in audit_epoch{e}.csv.", "{shown} von {n}; alle stehen in audit_epoch{e}.csv.";
        many_records: "{n} records, not listed here", "{n} Einträge, hier nicht aufgezählt";
        decision: "decision", "Entscheidung";
        photo: "photo", "Foto";
        instance: "instance", "Instanz";
        of_stones: "stones", "Steine";
        share: "share", "Anteil";
        edits: "Edits by hand", "Änderungen von Hand";
        edits_note: "The maps draw the outlines of edited stones dashed.", "Die Karten zeichnen die Umrisse geänderter Steine gestrichelt.";
        carried: "Stones looked for in epochs whose photos do not show them", "Steine, die in Epochen gesucht wurden, deren Fotos sie nicht zeigen";
        carried_note: "Stones that were found in this way have dotted outlines on the maps.", "Die Karten zeichnen die Umrisse so gefundener Steine gepunktet.";
        no_warnings: "No warnings.", "Keine Warnungen.";
        warnings: "Warnings ({n}; inputs left out: {out})", "Warnungen ({n}; ausgelassene Eingaben: {out})";
        about: "about", "betrifft";
        happened: "what happened", "was geschah";
        input: "input", "Eingabe";
        left_out: "left out", "ausgelassen";
        merged: "Merged instance", "Verschmolzene Instanz";
        split: "Split instance", "Geteilte Instanz";
        joined: "Joined fragment", "Angefügtes Bruchstück";
        outvoted: "Outvoted instance", "Überstimmte Instanz";
        dropped_islands: "Dropped islands", "Verworfene Inseln";
        dropped_stone: "Dropped stone", "Verworfener Stein";
    }
}
