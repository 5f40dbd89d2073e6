//! Doubts about a run as a whole.

use super::message::{Message, messages};

messages! {
    DOUBTS {
        NOT_CONVERGED = "not-converged":
            "the adjustment did not converge in {iterations} iterations: more than a tenth of the stones still move, so its motions and \
            their intervals must not be relied on. {cause}",
            "die Ausgleichung ist in {iterations} Iterationen nicht konvergiert: mehr als ein Zehntel der Steine bewegt sich noch, auf \
            ihre Bewegungen und deren Intervalle ist kein Verlass. {cause}";

        CAUSE_NOT_FIT:
            "Photos find {found} of the {sought} stones that they should show where clouds and cameras put them; so few suggest that \
            cameras and clouds do not fit each other (frame, direction of an axis, focal length)",
            "Die Fotos finden {found} der {sought} Steine, die sie zeigen müssten, dort, wo Punktwolken und Kameras sie vermuten lassen; so \
            wenige sprechen dafür, dass Kameras und Punktwolken nicht zueinander passen (System, Richtung einer Achse, Brennweite)";

        CAUSE_FIT:
            "Photos find {found} of the {sought} stones that they should show where clouds and cameras put them, so cameras and clouds fit \
            each other; masks of things other than stones, or surfaces that changed, are more likely",
            "Die Fotos finden {found} der {sought} Steine, die sie zeigen müssten, dort, wo Punktwolken und Kameras sie vermuten lassen; Kameras \
            und Punktwolken passen also zueinander. Wahrscheinlicher sind Masken, die keine Steine sind, oder veränderte Oberflächen";

        CAUSE_OPEN:
            "Either the epochs' clouds do not fit each other or their masks, or the masks show something other than stones: without \
            photos this cannot be decided",
            "Entweder passen die Punktwolken der Epochen nicht zueinander oder nicht zu ihren Masken, oder die Masken zeigen etwas anderes \
            als Steine: ohne Fotos lässt sich das nicht entscheiden";

        SIDE_UNSURE = "outside-unsure":
            "no camera or scanner position tells which side of the wall is outside, and the cloud alone does not show it clearly \
            enough: out-of-plane motions may have the wrong sign. Look at the views in the report: if the wall is seen from behind, \
            give a point in front of it, `[views] outside = [x, y, z]`, or clouds that include the ground in front of the wall",
            "keine Kamera- oder Scannerposition sagt, welche Seite der Mauer außen ist, und die Punktwolke zeigt es zu schwach: \
            Bewegungen aus der Ebene können das falsche Vorzeichen haben. Die Ansichten im Bericht ansehen: ist die Mauer von hinten zu \
            sehen, einen Punkt vor ihr angeben, `[views] outside = [x, y, z]`, oder Punktwolken, die den Boden vor der Mauer zeigen";

        BESIDE = "cloud-off-photos":
            "the cloud lies {length} mm ({along} along, {up} up) off the stones that the photos show{compared}, so stones are cut out \
            of the cloud beside their place, and their motions must not be relied on",
            "die Punktwolke liegt {length} mm ({along} längs, {up} hoch) neben den Steinen, die die Fotos zeigen{compared}; Steine sind \
            also neben ihrem Platz aus der Wolke geschnitten, auf ihre Bewegungen ist kein Verlass";

        COMPARED:
            ", compared with epoch {first}",
            ", verglichen mit der Epoche {first}";

        TORN = "votes-disagree":
            "the photos disagree on where the stones are: a typical stone gets only {share} % of the photos' votes on its points, and one \
            in the most photos gets {best} %. Stones are therefore cut out of the cloud beside their place, and their motions must not \
            be relied on. {cause}",
            "die Fotos stimmen nicht darin überein, wo die Steine liegen: ein typischer Stein erhält nur {share} % der Stimmen der \
            Fotos zu seinen Punkten, einer, den die meisten Fotos zeigen, {best} %. Steine sind also neben ihrem Platz aus der Wolke \
            geschnitten, auf ihre Bewegungen ist kein Verlass. {cause}";

        MISREGISTERED_EPOCH = "misregistered-epoch":
            "{cells} pieces of plane surfaces off the wall appear shifted by ({shown}) mm (x, y, z) against the first epoch. The stations \
            and strips alone give a shift of ({found}) mm with a standard deviation of {sd} mm. If these surfaces did not move, all \
            motions are wrong by the difference",
            "{cells} ebene Flächenstücke neben der Mauer erscheinen gegenüber der ersten Epoche um ({shown}) mm (x, y, z) verschoben. Aus \
            den Standpunkten und Streifen allein folgt eine Verschiebung von ({found}) mm mit einer Standardabweichung von {sd} mm. \
            Haben sich diese Flächen nicht bewegt, so sind alle Bewegungen um den Unterschied falsch";

        FEW_MEASURED = "few-measured":
            "only {measured} of the {matched} stones found in both epochs could be measured ({reasons}). That no motion is shown for \
            the others does not mean that they did not move. {cause}",
            "nur {measured} der {matched} Steine, die in beiden Epochen gefunden wurden, waren zu messen ({reasons}). Dass für die \
            anderen keine Bewegung gezeigt wird, heißt nicht, dass sie sich nicht bewegt haben. {cause}";

        UNCOVERED = "uncovered-wall":
            "the {measured} measured stones cover {area} m2 of the {walls} m2 of walls that the clouds show around them: nothing is \
            known of the rest",
            "die {measured} gemessenen Steine bedecken {area} m2 der {walls} m2 Mauern, die die Punktwolken um sie herum zeigen: über \
            den Rest ist nichts bekannt";

        PART_REFUSED = "part-in-disagreement":
            "{stones} neighbouring stones of a part of the wall, around stone {stone}, have no motion: the clouds of the two epochs show \
            different surfaces there, or a motion unlike that of the rest which nothing confirms. Something covers the part (plants, snow, a \
            banner), it moved, or its clouds or masks mislead. Its motion is unknown",
            "{stones} benachbarte Steine eines Teils der Mauer um Stein {stone} haben keine Bewegung: die Punktwolken der beiden Epochen zeigen \
            dort verschiedene Oberflächen, oder eine Bewegung anders als die der übrigen Mauer, die nichts bestätigt. Etwas bedeckt den Teil \
            (Pflanzen, Schnee, ein Banner), er hat sich bewegt, oder seine Punktwolken oder Masken täuschen. Seine Bewegung ist \
            unbekannt";

        BLIND = "insensitive":
            "motions below about {limit} mm cannot be detected in the weakest direction, {excess} times what the spacing and the noise \
            of the points allow: a small motion would not be seen. {cause}",
            "Bewegungen unter etwa {limit} mm sind in der schwächsten Richtung nicht nachweisbar, dem {excess}-Fachen dessen, was \
            Abstand und Rauschen der Punkte erlauben: eine kleine Bewegung wäre nicht zu sehen. {cause}";

        STRETCHED = "wrong-scale":
            "the wall changed its size by {strain} +- {half_width} mm per metre, and by {lesser} mm per metre in the direction that \
            changed least. Temperature explains 0.3 mm per metre, so the cloud of one epoch may have a wrong scale: the common \
            stretch counts as an error, not as a motion",
            "die Mauer hat ihre Größe um {strain} +- {half_width} mm je Meter geändert, in der Richtung der kleinsten Änderung um \
            {lesser} mm je Meter. Temperatur erklärt 0,3 mm je Meter; die Punktwolke einer Epoche kann also einen falschen Maßstab \
            haben: die gemeinsame Dehnung gilt als Fehler, nicht als Bewegung";

        TURNED = "turned-epoch":
            "this epoch is turned by {angle} degrees against the first as a whole. Motions are computed for small rotations: here they \
            are wrong by up to {error} mm, which standard deviations of {sd} mm do not contain",
            "diese Epoche ist als Ganzes um {angle} Grad gegen die erste gedreht. Bewegungen werden für kleine Drehungen berechnet: hier \
            sind sie um bis zu {error} mm falsch, was Standardabweichungen von {sd} mm nicht enthalten";
    }
}
