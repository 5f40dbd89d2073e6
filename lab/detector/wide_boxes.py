"""Makes boxes as a person draws them out of masks: each side 5 % of the box further out, so 10 % wider.

python3 wide_boxes.py INSTANCES.json OUT.json, both COCO; then stonewise detector segment IMAGES --boxes OUT.json --reference INSTANCES.json
"""

import json
import sys

source, out = sys.argv[1:]
with open(source) as file:
    coco = json.load(file)
for annotation in coco["annotations"]:
    left, top, width, height = annotation["bbox"]
    annotation["bbox"] = [left - 0.05 * width, top - 0.05 * height, 1.1 * width, 1.1 * height]
    del annotation["segmentation"]
with open(out, "w") as file:
    json.dump(coco, file)
