#include "engine/onnx/divisors.h"

#include <map>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/onnx/wire.h"

namespace litags {
namespace {

using Fields = std::vector<WireField>;

// Field numbers of onnx.proto.
namespace model_field {
constexpr int kGraph = 7;
}
namespace graph_field {
constexpr int kNode = 1, kInitializer = 5;
}
namespace node_field {
constexpr int kInput = 1, kOutput = 2, kOpType = 4, kAttribute = 5;
}
namespace attribute_field {
constexpr int kTensor = 5;
}
namespace tensor_field {
constexpr int kName = 8;
}

std::vector<std::string_view> ValuesOf(const Fields& fields, int number) {
  std::vector<std::string_view> values;
  for (const WireField& field : fields) {
    if (field.number == number) values.push_back(field.value);
  }
  return values;
}

// The value of a field that a message has once (if it repeats, the last one counts); "" without.
std::string_view ValueOf(const Fields& fields, int number) {
  const std::vector<std::string_view> values = ValuesOf(fields, number);
  return values.empty() ? std::string_view() : values.back();
}

// The tensors of the graph that are constants, by name; false if the graph is broken.
bool FindConstants(const Fields& graph, std::map<std::string_view, std::string_view>* constants) {
  for (const std::string_view tensor : ValuesOf(graph, graph_field::kInitializer)) {
    const std::optional<Fields> fields = ReadWireFields(tensor);
    if (!fields) return false;
    (*constants)[ValueOf(*fields, tensor_field::kName)] = tensor;
  }
  for (const std::string_view node : ValuesOf(graph, graph_field::kNode)) {
    const std::optional<Fields> fields = ReadWireFields(node);
    if (!fields) return false;
    if (ValueOf(*fields, node_field::kOpType) != "Constant") continue;
    const std::vector<std::string_view> outputs = ValuesOf(*fields, node_field::kOutput);
    if (outputs.size() != 1) continue;
    for (const std::string_view attribute : ValuesOf(*fields, node_field::kAttribute)) {
      const std::optional<Fields> parts = ReadWireFields(attribute);
      if (!parts) return false;
      const std::vector<std::string_view> tensors = ValuesOf(*parts, attribute_field::kTensor);
      if (!tensors.empty()) (*constants)[outputs[0]] = tensors.back();
    }
  }
  return true;
}

// The node with another name for its second input.
std::string WithSecondInput(const Fields& node, std::string_view name) {
  std::string out;
  int inputs = 0;
  for (const WireField& field : node) {
    const bool second = field.number == node_field::kInput && ++inputs == 2;
    out += second ? WireBytes(node_field::kInput, name) : std::string(field.whole);
  }
  return out;
}

}  // namespace

bool UnshareDivisors(std::string* model) {
  const std::optional<Fields> parts = ReadWireFields(*model);
  if (!parts || ValuesOf(*parts, model_field::kGraph).size() != 1) return false;
  const std::optional<Fields> graph = ReadWireFields(ValueOf(*parts, model_field::kGraph));
  std::map<std::string_view, std::string_view> constants;
  if (!graph || !FindConstants(*graph, &constants)) return false;

  std::string nodes_and_rest, copies;
  int count = 0;
  for (const WireField& field : *graph) {
    if (field.number == graph_field::kNode) {
      const std::optional<Fields> node = ReadWireFields(field.value);
      const std::vector<std::string_view> inputs = ValuesOf(*node, node_field::kInput);
      const auto divisor = inputs.size() == 2 && ValueOf(*node, node_field::kOpType) == "Div"
                               ? constants.find(inputs[1])
                               : constants.end();
      if (divisor != constants.end()) {
        const std::string name = absl::StrCat("litags_divisor_", count++);
        // A second name in a tensor replaces the first.
        std::string copy(divisor->second);
        copy += WireBytes(tensor_field::kName, name);
        copies += WireBytes(graph_field::kInitializer, copy);
        nodes_and_rest += WireBytes(graph_field::kNode, WithSecondInput(*node, name));
        continue;
      }
    }
    nodes_and_rest += field.whole;
  }
  if (count == 0) return true;

  std::string out;
  for (const WireField& field : *parts) {
    if (field.number == model_field::kGraph) {
      out += WireBytes(model_field::kGraph, nodes_and_rest + copies);
    } else {
      out += field.whole;
    }
  }
  *model = std::move(out);
  return true;
}

}  // namespace litags
