"""Makes bright.onnx: a network with the interface of torchvision's exported Mask R-CNN that finds what is bright in two boxes.

python3 generate.py   (onnx 1.23.2)
"""

from pathlib import Path

from onnx import TensorProto, checker, helper, save

constant = lambda name, kind, shape, values: helper.make_node(
    "Constant", [], [name], value=helper.make_tensor(name, kind, shape, values)
)
nodes = [
    constant("scores", TensorProto.FLOAT, [2], [0.25, 0.75]),
    constant("labels", TensorProto.INT64, [2], [1, 1]),
    constant("boxes", TensorProto.FLOAT, [2, 4], [1, 1, 4, 3, 5, 2, 9, 6]),
    constant("twice", TensorProto.INT64, [4], [2, 1, 1, 1]),
    # Green alone tells channels and their order apart.
    constant("one", TensorProto.INT64, [1], [1]),
    constant("two", TensorProto.INT64, [1], [2]),
    constant("first", TensorProto.INT64, [1], [0]),
    helper.make_node("Slice", ["image", "one", "two", "first"], ["green"]),
    helper.make_node("Unsqueeze", ["green", "first"], ["mask"]),
    helper.make_node("Tile", ["mask", "twice"], ["masks"]),
]
value = helper.make_tensor_value_info
graph = helper.make_graph(
    nodes,
    "bright",
    [value("image", TensorProto.FLOAT, [3, "rows", "columns"])],
    [
        value("boxes", TensorProto.FLOAT, [2, 4]),
        value("labels", TensorProto.INT64, [2]),
        value("scores", TensorProto.FLOAT, [2]),
        value("masks", TensorProto.FLOAT, [2, 1, "rows", "columns"]),
    ],
)
model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 16)], ir_version=8)
checker.check_model(model)
save(model, Path(__file__).with_name("bright.onnx"))
