//! What a run notes beside its results, and inputs that it left out.

use super::message::{Message, messages};

messages! {
    NOTICES {
        EPOCHS_NUMBERED = "epochs-numbered":
            "motions are relative to epoch \"{name}\"; the results number the epochs {numbered}",
            "Bewegungen gelten gegenüber Epoche „{name}“; in den Ergebnissen haben die Epochen die Nummern {numbered}";

        EPOCH_WITHOUT_DATE = "missing-condition":
            "epoch \"{name}\" has no date and gets no conditions from {file}: add its date",
            "Epoche „{name}“ hat kein Datum und bekommt keine Werte aus {file}: ihr Datum angeben";

        CONDITION_BETWEEN = "missing-condition":
            "{file}: no {name} on {date}: the readings before and after are {days} days apart, more than \
            conditions.longest_gap_days = {longest}",
            "{file}: kein Wert für {name} am {date}: die Ablesungen davor und danach liegen {days} Tage auseinander, mehr als \
            conditions.longest_gap_days = {longest}";

        CONDITION_BEFORE = "missing-condition":
            "{file}: no {name} on {date}, which is before its readings begin; nothing is extrapolated",
            "{file}: kein Wert für {name} am {date}: der Tag liegt vor der ersten Ablesung; es wird nicht extrapoliert";

        CONDITION_AFTER = "missing-condition":
            "{file}: no {name} on {date}, which is after its readings end; nothing is extrapolated",
            "{file}: kein Wert für {name} am {date}: der Tag liegt nach der letzten Ablesung; es wird nicht extrapoliert";

        EDIT_WITHOUT_EFFECT = "edit-without-effect":
            "{edit} has no effect; {reasons}",
            "{edit} bewirkt nichts; {reasons}";

        INVALID_POINTS = "invalid-points":
            "points without finite coordinates, left out: {n}",
            "Punkte ohne endliche Koordinaten, weggelassen: {n}";

        UNUSED_POINTS = "unused-points":
            "withheld points and noise (classes 7 and 18), left out: {n} of {all}",
            "zurückgehaltene Punkte und Rauschen (Klassen 7 und 18), weggelassen: {n} von {all}";

        VIEWS_OF_COLOURS = "views":
            "stones are looked for in {n} views of the cloud's colours",
            "Steine werden in {n} Ansichten der Farben der Punktwolke gesucht";

        VIEWS_OF_INTENSITIES = "views":
            "stones are looked for in {n} views of the cloud's intensities",
            "Steine werden in {n} Ansichten der Intensitäten der Punktwolke gesucht";

        VIEWS_OF_RELIEF = "views":
            "stones are looked for in {n} views of the cloud's relief, shaded",
            "Steine werden in {n} Ansichten des schattierten Reliefs der Punktwolke gesucht";

        PHOTOS_CHOSEN = "photos-chosen":
            "stones are looked for in {n} of {all} photos, at scale {scales}: {each} photos show each part of the wall, or as many as \
            there are; {stones}",
            "Steine werden in {n} von {all} Fotos gesucht, im Maßstab {scales}: jeden Teil der Mauer zeigen {each} Fotos oder alle, die \
            es gibt; {stones}";

        SIZE_OF_STONES:
            "nine tenths of the stones found in a first look are larger than {size} m",
            "neun Zehntel der bei einem ersten Blick gefundenen Steine sind größer als {size} m";

        SIZE_UNKNOWN:
            "a first look shows too few stones to tell how large they are",
            "ein erster Blick zeigt zu wenige Steine, um ihre Größe zu bestimmen";

        AUTO_STABLE = "auto-stable":
            "auto_stable: areas off the wall ({count} found) are taken for stable, as far as they agree with each other",
            "auto_stable: Flächen neben der Mauer ({count} gefunden) gelten als stabil, soweit sie miteinander übereinstimmen";

        STONES_MISSED = "stones-missed":
            "a typical stone gets {share} % of the photos' votes on its points: the detector misses it in some of the photos that show it. Where \
            the most photos show a stone, that is {best} %, and photos find {found} of {sought} stones where clouds and cameras put them, so these \
            fit each other and motions do not suffer",
            "ein typischer Stein erhält {share} % der Stimmen der Fotos zu seinen Punkten: in manchen Fotos, die ihn zeigen, findet ihn der Detektor \
            nicht. Zeigen die meisten Fotos einen Stein, sind es {best} %, und die Fotos finden {found} von {sought} Steinen dort, wo Punktwolken und \
            Kameras sie vermuten lassen; diese passen also zueinander, und Bewegungen leiden nicht darunter";

        STONES_MISSED_BY_VOTES = "stones-missed":
            "a typical stone gets {share} % of the photos' votes on its points: the detector misses it in some photos that show it. Where \
            the most photos show a stone, that is {best} %, so clouds and cameras fit each other, and motions do not suffer",
            "ein typischer Stein erhält {share} % der Stimmen der Fotos zu seinen Punkten: in manchen Fotos, die ihn zeigen, findet ihn der \
            Detektor nicht. Zeigen die meisten Fotos einen Stein, sind es {best} %; Punktwolken und Kameras passen also zueinander, und \
            Bewegungen leiden nicht darunter";

        COMPONENT_AT_BOUND = "component-at-bound":
            "the variance component \"{name}\" lies at the upper end of its range: the survey shows larger differences than are expected of \
            masonry. Parts of the wall moved unlike the rest, clouds of the epochs do not fit each other, or masks show things other than stones",
            "die Varianzkomponente „{name}“ liegt am oberen Ende ihres Bereichs: die Aufnahme zeigt größere Unterschiede, als bei Mauerwerk \
            zu erwarten sind. Teile der Mauer haben sich anders bewegt als der Rest, Punktwolken der Epochen passen nicht zueinander, oder Masken \
            zeigen anderes als Steine";

        COULD_BE_STABLE = "could-be-stable":
            "areas off the wall are seen in both epochs and could show their registration ({count} found): auto_stable = true uses them all, \
            [[registration.stable]] those that you know did not move, such as corners = {corners}",
            "Flächen neben der Mauer sind in beiden Epochen zu sehen und könnten deren Registrierung zeigen ({count} gefunden): auto_stable = true \
            verwendet alle, [[registration.stable]] die, von denen Sie wissen, dass sie sich nicht bewegt haben, zum Beispiel \
            corners = {corners}";

        MEAN_MOTION = "mean-motion":
            "mean motion of the measured stones that are not loose, as measured: {mean} (standard deviations with the error of the \
            epochs' registration)",
            "mittlere Bewegung der gemessenen Steine, die nicht lose sind, wie gemessen: {mean} (Standardabweichungen mit dem \
            Registrierungsfehler der Epochen)";

        MEAN_MOTION_OF_UNKNOWN_DATUM = "mean-motion":
            "mean motion of the measured stones that are not loose, as measured: {mean} (standard deviations without the error of the \
            epochs' registration, which is unknown)",
            "mittlere Bewegung der gemessenen Steine, die nicht lose sind, wie gemessen: {mean} (Standardabweichungen ohne den \
            Registrierungsfehler der Epochen, der unbekannt ist)";

        TOO_MANY_SOURCES = "too-many-sources":
            "the clouds name {n} sources, more than the 100 stations or strips that can be compared with each other; they count as one. \
            Where they number scan lines or points, say so with sources = \"file\" or \"none\" in the epoch",
            "die Punktwolken nennen {n} Quellen, mehr als die 100 Standpunkte oder Streifen, die sich miteinander vergleichen lassen; sie \
            gelten als eine. Nummerieren sie Scanzeilen oder Punkte, gehört sources = \"file\" oder \"none\" in die Epoche";

        NAMED_AREA:
            "[[registration.stable]] \"{name}\"",
            "[[registration.stable]] „{name}“";

        NUMBERED_AREA:
            "[[registration.stable]] number {n}",
            "[[registration.stable]] Nummer {n}";

        AREA_OFF_WALL:
            "the area off the wall around ({place})",
            "die Fläche neben der Mauer um ({place})";

        STABLE_MOVED = "stable-moved":
            "{area} moved against the other stable areas and is left out",
            "{area} hat sich gegen die anderen stabilen Flächen bewegt und ist weggelassen";

        STABLE_ALONE = "stable-alone":
            "{area} alone shows that the registration is off by {shift_mm} mm, {sds} times the standard deviation expected without it. \
            Nothing tells whether the registration is off or the area moved; if the area moved, all motions are wrong by that amount. \
            Name a second stable area that shows the same directions, or look at this one on site. The deformation of the wall does \
            not depend on it",
            "{area} allein zeigt einen Registrierungsfehler von {shift_mm} mm, das {sds}-Fache der Standardabweichung, die ohne sie zu \
            erwarten ist. Nichts zeigt, ob die Registrierung falsch ist oder sich die Fläche bewegt hat; hat sie sich bewegt, sind alle \
            Bewegungen um diesen Betrag falsch. Eine zweite stabile Fläche nennen, die dieselben Richtungen zeigt, oder diese vor Ort \
            ansehen. Die Verformung der Mauer hängt nicht davon ab";

        KNOWN_LENGTH:
            "length of {length_m} m in epoch {epoch}",
            "Länge von {length_m} m in der Epoche {epoch}";

        RESTS_ON_ONE = "rests-on-one":
            "the verdict rests on {name} alone: without it, {change}",
            "das Urteil beruht allein auf {name}: ohne diese Beobachtung {change}";

        LARGEST_BEYOND:
            "the largest motion would be {without_mm} mm, outside its 95 % interval of {low_mm} to {high_mm} mm",
            "wäre die größte Bewegung {without_mm} mm und läge außerhalb ihres 95-%-Intervalls von {low_mm} bis {high_mm} mm";

        STATE_CHANGES:
            "its state would be another",
            "wäre sein Zustand ein anderer";

        STABLE_TOO_FEW = "stable-too-few":
            "[[registration.stable]] does not show the epochs' registration: too few plane cells ({cells}) are seen in both epochs; it is \
            taken as unknown. Name areas with points in both epochs and faces in three directions, or state epoch_error_m",
            "[[registration.stable]] zeigt die Registrierung der Epochen nicht: zu wenige ebene Zellen ({cells}) sind in beiden Epochen zu \
            sehen; sie gilt als unbekannt. Flächen mit Punkten in beiden Epochen und mit Seiten in drei Richtungen nennen, oder \
            epoch_error_m angeben";

        OFF_WALL_TOO_FEW = "stable-too-few":
            "auto_stable: surfaces off the wall do not show the epochs' registration: too few plane cells ({cells}) are seen in both epochs",
            "auto_stable: Flächen neben der Mauer zeigen die Registrierung der Epochen nicht: zu wenige ebene Zellen ({cells}) sind in \
            beiden Epochen zu sehen";

        REGISTRATION_UNKNOWN = "datum":
            "the registration error of the epochs is unknown: limits, intervals and significance hold for motions against the \
            common rigid motion of the measured stones",
            "der Registrierungsfehler der Epochen ist unbekannt: Grenzen, Intervalle und Signifikanz gelten für Bewegungen gegen die \
            gemeinsame starre Bewegung der gemessenen Steine";

        ALIGNED = "aligned":
            "aligned by {stones} of {covered} stones: turned by {degrees} degrees and moved by {metres} m at the middle of the wall, \
            centroids agree within {rms_mm} mm; the motion of the wall as a whole is unknown unless stable areas or \
            instruments show it; its deformation does not depend on it",
            "an {stones} von {covered} Steinen ausgerichtet: um {degrees} Grad gedreht und in der Mitte der Mauer um {metres} m bewegt, \
            Schwerpunkte stimmen auf {rms_mm} mm überein; die Bewegung der Mauer als Ganzes ist unbekannt, wenn weder stabile \
            Flächen noch Instrumente sie zeigen; ihre Verformung hängt nicht davon ab";

        DATUM_ALIGNED = "datum":
            "the epochs were aligned by their stones: how the wall moved as a whole is not known; limits, intervals and significance hold \
            for motions against the common rigid motion of the measured stones",
            "die Epochen wurden an ihren Steinen ausgerichtet: wie sich die Mauer als Ganzes bewegt hat, ist nicht bekannt; Grenzen, \
            Intervalle und Signifikanz gelten für Bewegungen gegen die gemeinsame starre Bewegung der gemessenen Steine";

        DATUM_STABLE = "datum":
            "the stable areas show a registration error of {error_mm} mm at the middle of the wall: it is taken off the motions, and what \
            stays uncertain of it is in limits and intervals",
            "die stabilen Flächen zeigen in der Mitte der Mauer einen Registrierungsfehler von {error_mm} mm: er ist von den Bewegungen \
            abgezogen, und was an ihm unsicher bleibt, steckt in Grenzen und Intervallen";

        DATUM_STATED = "datum":
            "the project states a registration error of {error_mm} mm per axis and epoch; limits and intervals include it",
            "das Projekt gibt einen Registrierungsfehler von {error_mm} mm je Achse und Epoche an; Grenzen und Intervalle enthalten ihn";

        DATUM_ONE_SURVEY = "datum":
            "both epochs are parts of one survey: there is no registration error between them",
            "beide Epochen sind Teile einer Aufnahme: zwischen ihnen gibt es keinen Registrierungsfehler";

        DATUM_SOURCES = "datum":
            "the registration error follows from how the stations and strips of each epoch differ, and from an assumed error of {error_mm} mm \
            per axis that all sources of an epoch share; limits and intervals include both",
            "der Registrierungsfehler folgt daraus, wie sich Standpunkte und Streifen jeder Epoche unterscheiden, und aus einem angenommenen \
            Fehler von {error_mm} mm je Achse, den alle Quellen einer Epoche teilen; Grenzen und Intervalle enthalten beides";

        DATUM_INSTRUMENTS = "datum":
            "{n} instruments in use show a registration error of {error_mm} mm at the middle of the wall besides what else is known of it: \
            it is taken off the motions, and what stays uncertain of it is in limits and intervals",
            "{n} verwendete Instrumente zeigen in der Mitte der Mauer einen Registrierungsfehler von {error_mm} mm über das hinaus, was \
            sonst von ihm bekannt ist: er ist von den Bewegungen abgezogen, und was an ihm unsicher bleibt, steckt in Grenzen und Intervallen";

        INSTRUMENTS_LEFT_OUT = "instruments-left-out":
            "instruments that are not compared with the stones: {names}; instruments.json says why",
            "Instrumente, die nicht mit den Steinen verglichen sind: {names}; instruments.json nennt die Gründe";

        INSTRUMENTS_DISAGREE = "instruments-disagree":
            "instruments that disagree with the stones around them: {names}",
            "Instrumente, die mit den umliegenden Steinen nicht übereinstimmen: {names}";

        INSTRUMENTS_CONTRADICTED = "instruments-not-used":
            "instruments with use = true contradict each other or what else is known of the datum, and are not used: look at their differences \
            in instruments.json, and correct or remove the wrong ones",
            "Instrumente mit use = true widersprechen einander oder dem, was sonst vom Datum bekannt ist, und sind nicht verwendet: ihre \
            Differenzen in instruments.json ansehen, und falsche berichtigen oder entfernen";

        INSTRUMENTS_UNDETERMINED = "instruments-not-used":
            "instruments with use = true do not determine how the epoch lies, and nothing else is known of it: they are not used; three \
            instruments with readings along x, y and z that are not on one line determine it",
            "Instrumente mit use = true bestimmen nicht, wie die Epoche liegt, und sonst ist nichts davon bekannt: sie sind nicht verwendet; \
            drei Instrumente mit Messungen längs x, y und z, die nicht auf einer Geraden liegen, bestimmen es";

        NO_MASKS = "missing-masks":
            "no masks for this photo in {file}",
            "keine Masken für dieses Foto in {file}";

        NO_CAMERA = "photo-without-camera":
            "no camera in {file}; the photo is left out",
            "keine Kamera in {file}; das Foto ist weggelassen";

        UNUSABLE_CAMERA = "photo-without-camera":
            "its camera cannot be used ({reason}) in {file}; the photo is left out",
            "seine Kamera in {file} ist nicht zu verwenden ({reason}); das Foto ist weggelassen";

        NO_SUCH_PHOTO = "camera-not-used":
            "cameras not used because their photos are not in {folder}: {n}, for example {name}",
            "Kameras nicht verwendet, weil ihre Fotos nicht in {folder} liegen: {n}, zum Beispiel {name}";

        CAMERA_NOT_USED = "camera-not-used":
            "camera not used: {reason}",
            "Kamera nicht verwendet: {reason}";

        PHOTO_NOT_TRACKED = "photo-not-tracked":
            "{error}: the photo is not used to measure stones",
            "{error}: das Foto wird nicht zum Messen verwendet";

        PHOTO_NOT_SHOWN = "photo-not-shown":
            "{error}: the photo is not shown in the report",
            "{error}: das Foto wird im Bericht nicht gezeigt";

        PHOTO_SIZE = "photo-size":
            "the photo is {width}x{height} px, its camera {camera_width}x{camera_height} px: use it at the size of its camera",
            "das Foto hat {width}x{height} px, seine Kamera {camera_width}x{camera_height} px: es in der Größe seiner Kamera verwenden";
    }
}
