"""The losses of the detector, for whole batches at once: tensors of fixed shapes and no waiting for the device.

They are the losses that torchvision's Mask R-CNN computes image by image (Ren et al. 2015, He et al. 2017), with
soft mask targets, and without boxes that lie mostly where nothing is known.
"""

import torch
import torch.nn.functional as F

# A box of which more than this share is unknown is no example of background.
MOST_UNKNOWN = 0.5
# Boxes of an image in the losses of the proposals, and the largest share of them that hold a stone.
ANCHORS, ANCHOR_SHARE = 256, 0.5
# The same for box and mask head.
REGIONS, REGION_SHARE = 256, 0.25
# Passes of suppression: in each, boxes that the pass before suppressed no longer suppress others. To agree with
# greedy suppression, it takes as many as the longest chain of boxes that overlap one another.
SUPPRESSIONS = 12
SMOOTH = 1 / 9
# Images whose anchors are compared with all their stones at a time: 1.5 GB with 2,400 stones.
AT_ONCE = 4


def overlaps(a, b):
    """IoU [batch, A, B] of boxes [batch, A, 4] and [batch or 1, B, 4]."""
    def extent(low):
        shared = torch.minimum(a[:, :, None, low + 2], b[:, None, :, low + 2])
        return shared.sub_(torch.maximum(a[:, :, None, low], b[:, None, :, low])).clamp_(min=0)

    def area(boxes):
        return (boxes[..., 2] - boxes[..., 0]) * (boxes[..., 3] - boxes[..., 1])

    inner = extent(0).mul_(extent(1))
    union = (area(a)[:, :, None] + area(b)[:, None]).sub_(inner).clamp_(min=1e-6)
    return inner.div_(union)


def unknown_share(unknown, boxes):
    """Share of each box [batch or 1, B, 4] that is unknown [batch, rows, columns], from sums over all rectangles
    from the corner (Crow 1984)."""
    batch, height, width = unknown.shape
    sums = F.pad(unknown.float().cumsum(1).cumsum(2), (1, 0, 1, 0)).reshape(batch, -1)
    x0, x1 = (boxes[..., i].round().clamp(0, width).long() for i in (0, 2))
    y0, y1 = (boxes[..., i].round().clamp(0, height).long() for i in (1, 3))
    at = lambda y, x: sums.gather(1, (y * (width + 1) + x).expand(batch, -1))
    inside = at(y1, x1) - at(y0, x1) - at(y1, x0) + at(y0, x0)
    return inside / ((x1 - x0) * (y1 - y0)).clamp(min=1)


def match(iou, high, low, keep_best):
    """Labels (1 stone, 0 none, -1 neither) and stones [batch, boxes] of boxes with IoU [batch, stones, boxes]."""
    best, stone = iou.max(1)
    labels = torch.where(best >= high, 1, torch.where(best < low, 0, -1))
    if keep_best:
        highest = iou.amax(2, keepdim=True)
        is_best = ((iou == highest) & (highest > 0)).any(1)
        labels = torch.where(is_best, 1, labels)
    return labels, stone


def draw(labels, count, share):
    """Places of boxes drawn at random, with stones and without, and which places of either set are valid."""
    chance = torch.rand(labels.shape, device=labels.device)
    most = min(int(count * share), labels.shape[1])
    first, positive = torch.where(labels == 1, chance, -1.0).topk(most)
    second, negative = torch.where(labels == 0, chance, -1.0).topk(min(count, labels.shape[1]))
    has, lacks = first >= 0, second >= 0
    room = count - has.sum(1, keepdim=True)
    return positive, negative, has, lacks & (torch.arange(lacks.shape[1], device=labels.device) < room)


def taken(values, places):
    """Values [batch, n, ...] at places [batch, k]."""
    extra = values.shape[2:]
    return values.gather(1, places.reshape(*places.shape, *[1] * len(extra)).expand(*places.shape, *extra))


def encoded(coder, wanted, boxes):
    """Offsets that turn boxes [batch, k, 4] into the wanted ones; finite also for boxes without extent."""
    def real(x):
        return torch.cat([x[..., :2], torch.maximum(x[..., 2:], x[..., :2] + 0.1)], -1).reshape(-1, 4)

    return coder.encode_single(real(wanted), real(boxes)).reshape(boxes.shape)


def mean(values, is_valid, count):
    return torch.where(is_valid, values, 0.0).sum() / count.clamp(min=1)


def suppressed(boxes, limit):
    """Which of boxes [batch, n, 4], best first, overlap a better one that is not itself suppressed."""
    repeats = torch.tril(overlaps(boxes, boxes) > limit, -1)
    keep = torch.ones(boxes.shape[:2], dtype=torch.bool, device=boxes.device)
    for _ in range(SUPPRESSIONS):
        keep = ~(repeats & keep[:, None]).any(2)
    return ~keep


def propose(rpn, logits, offsets, anchors, counts, size):
    """The best boxes of each image, and which of them are valid."""
    boxes, scores, start = [], [], 0
    batch = len(logits)
    for count in counts:
        score, place = logits[:, start : start + count].topk(min(rpn.pre_nms_top_n(), count))
        of_level = anchors[start : start + count].expand(batch, -1, -1)
        shift = taken(offsets[:, start : start + count], place).reshape(-1, 4)
        box = rpn.box_coder.decode_single(shift, taken(of_level, place).reshape(-1, 4)).reshape(batch, -1, 4)
        box = box.clamp(min=0, max=size)
        is_gone = suppressed(box, rpn.nms_thresh) | ((box[..., 2:] - box[..., :2]).amin(2) < rpn.min_size)
        boxes.append(box)
        scores.append(torch.where(is_gone, -torch.inf, score))
        start += count
    best, place = torch.cat(scores, 1).topk(rpn.post_nms_top_n())
    return taken(torch.cat(boxes, 1), place), torch.isfinite(best)


def mask_targets(stones, numbers, boxes, cells, points=2):
    """Share of a stone in each cell of its box: [n, cells, cells]; images of stone numbers [batch, rows, columns],
    numbers [batch, k] and boxes [batch, k, 4]."""
    batch, height, width = stones.shape
    steps = (torch.arange(cells * points, device=boxes.device) + 0.5) / (cells * points)
    along = lambda i: (boxes[..., i, None] + steps * (boxes[..., i + 2] - boxes[..., i])[..., None]).floor().long()
    x, y = along(0), along(1)
    inside = ((x >= 0) & (x < width))[..., None, :] & ((y >= 0) & (y < height))[..., None]
    place = y.clamp(0, height - 1)[..., None] * width + x.clamp(0, width - 1)[..., None, :]
    found = stones.reshape(batch, -1).gather(1, place.reshape(batch, -1)).reshape(place.shape)
    hits = ((found == numbers[..., None, None]) & inside).float().flatten(0, 1)
    return F.avg_pool2d(hits[:, None], points)[:, 0]


def losses(model, images, relief, present, targets):
    """The five losses of a batch; `targets` holds `boxes` [batch, most, 4] and `numbers` [batch, most], 0 beyond the
    last stone, and `stones` and `unknown` [batch, rows, columns]."""
    features = model.features(images, relief, present)
    side, batch = images.shape[-1], len(images)
    gt, unknown = targets["boxes"], targets["unknown"]
    is_stone = targets["numbers"] > 0
    rpn, heads = model.rpn, model.roi_heads
    with model.precision():
        logits, offsets = rpn.head(features)
    flat = lambda x, k: x.permute(0, 2, 3, 1).reshape(batch, -1, k)
    logits = torch.cat([flat(x, 1) for x in logits], 1)[..., 0]
    offsets = torch.cat([flat(x, 4) for x in offsets], 1)
    anchors, counts = model.anchors(features, side)

    with torch.no_grad():
        found = []
        for some, is_real in zip(gt.split(AT_ONCE), is_stone.split(AT_ONCE)):
            found.append(match(torch.where(is_real[..., None], overlaps(some, anchors[None]), -1.0), 0.7, 0.3, True))
        labels, stone = (torch.cat(part) for part in zip(*found))
        labels = torch.where((labels == 0) & (unknown_share(unknown, anchors[None]) > MOST_UNKNOWN), -1, labels)
        positive, negative, has, lacks = draw(labels, ANCHORS, ANCHOR_SHARE)
        wanted = taken(gt, stone.gather(1, positive))
        shifts = encoded(rpn.box_coder, wanted, taken(anchors.expand(batch, -1, -1), positive))
        count = has.sum() + lacks.sum()
    of = F.binary_cross_entropy_with_logits
    right = of(logits.gather(1, positive), torch.ones_like(positive, dtype=torch.float32), reduction="none")
    wrong = of(logits.gather(1, negative), torch.zeros_like(negative, dtype=torch.float32), reduction="none")
    objectness = mean(right, has, count) + mean(wrong, lacks, count)
    found = F.smooth_l1_loss(taken(offsets, positive), shifts, beta=SMOOTH, reduction="none").sum(2)
    anchor_box = mean(found, has, count)

    with torch.no_grad():
        boxes, holds = propose(rpn, logits, offsets, anchors, counts, side)
        boxes, holds = torch.cat([boxes, gt], 1), torch.cat([holds, is_stone], 1)
        labels, stone = match(torch.where(is_stone[..., None], overlaps(gt, boxes), -1.0), 0.5, 0.5, False)
        doubtful = (labels == 0) & (unknown_share(unknown, boxes) > MOST_UNKNOWN)
        labels = torch.where(doubtful | ~holds, -1, labels)
        positive, negative, has, lacks = draw(labels, REGIONS, REGION_SHARE)
        places, ok = torch.cat([positive, negative], 1), torch.cat([has, lacks], 1)
        boxes, stone = taken(boxes, places), stone.gather(1, positive)
        most = positive.shape[1]
        shifts = encoded(heads.box_coder, taken(gt, stone), boxes[:, :most])
        labels = torch.zeros_like(places)
        labels[:, :most] = 1
        count = ok.sum()
        masks = mask_targets(targets["stones"], taken(targets["numbers"], stone), boxes[:, :most], 28)

    def regions(boxes):
        image = torch.arange(batch, device=boxes.device)[:, None, None].expand(-1, boxes.shape[1], 1)
        return torch.cat([image.float(), boxes], 2).flatten(0, 1)

    features = [level.float() for level in features]
    with model.precision():
        cells = heads.box_head(heads.box_roi_pool(features, regions(boxes)))
        classes, changes = (x.float() for x in heads.box_predictor(cells))
        cells = heads.mask_roi_pool(features, regions(boxes[:, :most]))
        drawn = heads.mask_predictor(heads.mask_head(cells))[:, 1].float()
    of_class = F.cross_entropy(classes, labels.flatten(), reduction="none").reshape(labels.shape)
    changes = changes.reshape(batch, -1, 2, 4)[:, :most, 1]
    box = F.smooth_l1_loss(changes, shifts, beta=SMOOTH, reduction="none").sum(2)
    mask = of(drawn, masks, reduction="none").mean((1, 2)).reshape(batch, -1)
    return {
        "objectness": objectness, "anchor_box": anchor_box, "class": mean(of_class, ok, count),
        "box": mean(box, has, count), "mask": mean(mask, has, has.sum()),
    }
