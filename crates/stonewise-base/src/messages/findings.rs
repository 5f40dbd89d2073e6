//! What a look at a survey finds against it.

use super::message::{Message, messages};

messages! {
    FINDINGS {
        NOT_SEEN = "cloud-not-in-photos": "no photo sees the cloud: are cameras and clouds in one frame, and in metres?",
            "kein Foto sieht die Punktwolke: sind Kameras und Punktwolken in einem System, und in Metern?";
        NO_POINTS = "extent": "the clouds hold no points", "die Punktwolken enthalten keine Punkte";
        TOO_LONG = "extent": "{x} x {y} x {z} m, {points} points: are the coordinates in metres? Cut the cloud to the structure",
            "{x} x {y} x {z} m, {points} Punkte: sind die Koordinaten in Metern? Die Punktwolke auf das Bauwerk zuschneiden";
        TOO_SMALL = "extent": "{x} x {y} x {z} m, {points} points: are the coordinates in metres?",
            "{x} x {y} x {z} m, {points} Punkte: sind die Koordinaten in Metern?";
        FROM_SCANNER = "origin": "points from a scanner", "Punkte von einem Scanner";
        FROM_PHOTOS = "origin": "points from photos", "Punkte aus Fotos";
        FROM_UNKNOWN = "origin": "neither intensities nor times nor colours show what the points come from; they count as scanned: state \
                     origin = \"scanner\" or \"photos\" in the epoch",
            "weder Intensitäten noch Zeiten noch Farben zeigen, woher die Punkte stammen; sie gelten als gescannt: das mit origin = \
            \"scanner\" oder \"photos\" in der Epoche angeben";
        ONE_BUNDLE = "origin": "its photos and those of the first epoch were adjusted in one bundle",
            "ihre Fotos und die der ersten Epoche wurden gemeinsam ausgeglichen";
        OWN_BUNDLE = "origin": "its photos and those of the first epoch were adjusted in bundles of their own, which bend their clouds \
                     differently: adjust the photos of all epochs in one bundle, which makes these errors several times smaller",
            "ihre Fotos und die der ersten Epoche wurden getrennt ausgeglichen; die Punktwolken sind dadurch verschieden verbogen: die Fotos \
            aller Epochen gemeinsam ausgleichen, das macht diese Fehler mehrfach kleiner";
        NO_LENGTH = "scale": "no known length fixes the scale of both epochs: measure one in each and name it in [[distances]]",
            "keine bekannte Länge legt den Maßstab beider Epochen fest: in jeder eine messen und in [[distances]] angeben";
        SPACING_VIEWS = "spacing": "{spacing} mm: in views of the cloud, nearly all stones at least {size} cm across are found, and some of the smaller ones",
            "{spacing} mm: in Ansichten der Punktwolke werden fast alle Steine ab {size} cm Breite gefunden, kleinere zum Teil";
        SPACING_WIDE = "spacing": "{spacing} mm: too wide to show the relief of single stones",
            "{spacing} mm: zu weit, um das Relief einzelner Steine zu zeigen";
        SPACING_UNKNOWN = "spacing": "too few points to tell", "zu wenige Punkte für eine Aussage";
        SYSTEM_UNIT = "units": "the clouds' coordinate system is in {unit}: transform them to a system in metres",
            "das Koordinatensystem der Punktwolken ist in {unit}: sie in ein System in Metern umrechnen";
        CONVERTED = "units": "the coordinates are in {unit}: they are read as metres, and all results are in metres",
            "die Koordinaten sind in {unit}: sie werden in Meter umgerechnet, und alle Ergebnisse sind in Metern";
        HEIGHTS_CONVERTED = "units": "eastings and northings are in {plane}, heights in {height}: both are read as metres, and all results are in metres",
            "Rechts- und Hochwerte sind in {plane}, Höhen in {height}: beide werden in Meter umgerechnet, und alle Ergebnisse sind in Metern";
        UNIT_RATIO = "units": "the clouds are {found} times as large as those of the first epoch; {ratio} would mean that {which} is in {unit}: \
                     export its coordinates in metres",
            "die Punktwolken sind {found}-mal so groß wie die der ersten Epoche; {ratio} hieße, dass {which} in {unit} vorliegt: ihre \
             Koordinaten in Metern ausgeben";
        SYSTEMS = "coordinate-systems": "the clouds are in different systems, {systems}: transform them to one",
            "die Punktwolken liegen in verschiedenen Systemen, {systems}: sie in eines umrechnen";
        NO_OVERLAP = "overlap": "the clouds do not overlap those of {first}: they reach from [{low}] to [{high}] m, {first} from [{first_low}] to [{first_high}] m; \
                     bring both into one frame, or let a run do so by their stones (registration.align = \"stones\")",
            "die Punktwolken überlappen die von {first} nicht: sie reichen von [{low}] bis [{high}] m, {first} von [{first_low}] bis [{first_high}] m; \
             beide in ein System bringen, oder einen Lauf das anhand der Steine tun lassen (registration.align = \"stones\")";
        LITTLE_OVERLAP = "overlap": "{share} % of the smaller epoch with {first}: are both in one frame? If not, \
                         registration.align = \"stones\" brings them together by their stones",
            "{share} % der kleineren Epoche mit {first}: sind beide in einem System? Wenn nicht, bringt registration.align = \"stones\" \
             sie anhand der Steine zusammen";
        SAME_FILE = "same-cloud": "reads {file}, and so does epoch {first}", "liest {file}, ebenso wie die Epoche {first}";
        SAME_POINTS = "same-cloud": "{share} % of the points are those of epoch {first}: is one epoch's cloud a copy of the other's?",
            "{share} % der Punkte sind die der Epoche {first}: ist die Punktwolke einer Epoche eine Kopie der anderen?";
        STABLE_EMPTY = "stable-empty": "{area} holds no point of this epoch: give its place in the frame of the clouds, in metres",
            "{area} enthält keinen Punkt dieser Epoche: ihren Ort im System der Punktwolken angeben, in Metern";
        TWICE = "points-twice": "{share} % of the points are there twice and would count twice, so the intervals of motions would be too small: name \
                each cloud only once",
            "{share} % der Punkte sind doppelt vorhanden und würden doppelt zählen; die Intervalle der Bewegungen wären dann zu klein: \
             jede Punktwolke nur einmal angeben";
        LIES_FLAT = "lies-flat": "nearly all surfaces lie flat, and only {share} % of the points are on steep ones; a wall is upright. If it lies on its back, \
                    Y points up in the cloud: export it with Z up, cameras included",
            "fast alle Flächen liegen waagrecht, nur {share} % der Punkte auf steilen; eine Mauer steht aufrecht. Liegt sie auf dem Rücken, zeigt in der \
             Punktwolke Y nach oben: sie mit Z nach oben ausgeben, samt den Kameras";
        NORTH_FIRST = "axis-order": "X is where northings are and Y where eastings are: if X points north, as for German surveyors, exchange both, or the wall \
                      is mirrored",
            "X liegt bei Hochwerten und Y bei Rechtswerten: zeigt X nach Norden, wie bei deutschen Vermessern, beide tauschen, sonst ist die \
             Mauer gespiegelt";
        MIRRORED = "mirrored-cloud": "the relief of the wall is the mirror image of that of the first epoch (correlation {mirrored}, unmirrored {plain}): an axis of \
                   one epoch points the wrong way, or two are exchanged (such as X and Y); export its cloud again",
            "das Relief der Mauer ist das Spiegelbild dessen der ersten Epoche (Korrelation {mirrored}, ungespiegelt {plain}): eine Achse einer \
             Epoche zeigt in die falsche Richtung, oder zwei sind vertauscht (etwa X und Y); ihre Punktwolke neu ausgeben";
        ROUGH = "rounded-coordinates": "the coordinates are in steps of {step} mm, which adds {noise} mm to the noise of the points: export them with more digits if \
                the scanner measures better",
            "die Koordinaten sind in Schritten von {step} mm angegeben, was dem Rauschen der Punkte {noise} mm hinzufügt: sie mit mehr Stellen \
             ausgeben, wenn der Scanner genauer misst";
        ROUNDED = "rounded-coordinates": "the coordinates are in steps of {step} mm, and the points lie {spacing} mm apart: export the coordinates with \
                  more digits",
            "die Koordinaten sind in Schritten von {step} mm angegeben, die Punkte liegen {spacing} mm auseinander: die \
             Koordinaten mit mehr Stellen ausgeben";
        NO_PHOTOS = "missing-photos": "none of the photos that {file} names ({total}) is in {folder}", "keines der Fotos, die {file} nennt ({total}), liegt in {folder}";
        MISSING_PHOTOS = "missing-photos": "missing in {folder}: {photos} ({missing} of {total} posed photos); copy them there, or take their cameras out of the camera file",
            "es fehlen in {folder}: {photos} ({missing} von {total} orientierten Fotos); sie dorthin kopieren oder ihre Kameras aus der Kameradatei nehmen";
        BROKEN_PHOTOS = "broken-photos": "cannot be read or are cut off: {photos}; copy them again",
            "nicht zu lesen oder abgeschnitten: {photos}; sie noch einmal kopieren";
        PHOTO_SIZES = "photo-size": "the photos are not as large as their cameras say: {photos}; use them at the size of their cameras",
            "die Fotos sind nicht so groß, wie ihre Kameras sagen: {photos}; sie in der Größe ihrer Kameras verwenden";
        FLAT_PHOTOS = "unlike-photos": "of one colour: {photos}; copy them again, or take their cameras out of the camera file",
            "einfarbig: {photos}; sie noch einmal kopieren oder ihre Kameras aus der Kameradatei nehmen";
        UNLIKE_PHOTOS = "unlike-photos": "show something other than the other photos do where they see the same points: {photos} (correlation {most} or less); does the photo have another's \
                        name, or is it turned?",
            "zeigen etwas anderes als die übrigen Fotos an denselben Punkten: {photos} (Korrelation höchstens {most}); trägt das Foto den Namen eines anderen, oder ist es gedreht?";
        UNLIKE_ALL = "unlike-photos": "no two photos show the same where they see the same points: are these the photos of these cameras, and are cameras and \
                     clouds in one frame?",
            "keine zwei Fotos zeigen dasselbe an denselben Punkten: sind dies die Fotos dieser Kameras, und liegen Kameras und Punktwolken in einem System?";
        BROKEN_MASKS = "missing-masks": "cannot be used for {photos}, and a run leaves these photos out: {reason}",
            "nicht zu verwenden für {photos}, ein Lauf lässt diese Fotos weg: {reason}";
        WITHOUT_MASKS = "missing-masks": "none in {file} for {photos}; a run leaves these photos out",
            "keine in {file} für {photos}; ein Lauf lässt diese Fotos weg";
        NO_MASK_FITS = "missing-masks": "none in {file} for any of the photos: masks are found by the names of the photos",
            "keine in {file} für irgendein Foto: Masken werden nach den Namen der Fotos gefunden";
        NO_MASK_USABLE = "unusable-masks": "none of the masks in {file} can be used: other lines of this table say why",
            "keine der Masken in {file} ist zu verwenden: andere Zeilen dieser Tabelle sagen, warum";
        ONE_MASK_EACH = "unusable-masks": "one single mask in each photo in {file}: every stone needs a mask, or a value, of its own",
            "eine einzige Maske in jedem Foto in {file}: jeder Stein braucht eine eigene Maske oder einen eigenen Wert";
        MASKS: "masks", "Masken";
        CAMERAS: "cameras against cloud", "Kameras gegen Punktwolke";
        EXTENT: "extent", "Ausdehnung";
        ORIGIN: "points", "Punkte";
        SCALE: "scale", "Maßstab";
        SPACING: "point spacing", "Punktabstand";
        UNITS: "units", "Einheiten";
        SYSTEM: "coordinate system", "Koordinatensystem";
        OVERLAP: "overlap", "Überlappung";
        CLOUDS: "clouds", "Punktwolken";
        PHOTOS: "photos", "Fotos";
        DEGREES: "degrees", "Grad";
        METRES: "metres", "Metern";
        FEET: "feet", "Fuß";
        SIZED_FEET: "feet ({m} m)", "Fuß ({m} m)";
        SIZED_UNIT: "units of {m} m", "Einheiten von {m} m";
        INCHES: "inches", "Zoll";
        CENTIMETRES: "centimetres", "Zentimetern";
        MILLIMETRES: "millimetres", "Millimetern";
        THIS_EPOCH: "this epoch", "diese Epoche";
        FIRST_EPOCH: "the first epoch", "die erste Epoche";
    }
}
