#include "host/simulator/program/states_output.h"

#include <fmt/format.h>

#include <bit>
#include <cassert>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <type_traits>
#include <utility>

namespace torquer::program {

namespace {

static_assert(std::endian::native == std::endian::little, "the layout is little-endian");

template <class T>
void Append(std::string& bytes, const T& value) {
  static_assert(std::is_arithmetic_v<T>);
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
}

// Header of a binary file: the list of fields as JSON.
std::string Header(const std::vector<StateField>& fields) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const StateField& field : fields) {
    nlohmann::ordered_json shape = nlohmann::ordered_json::array();
    if (field.values_of_node > 0) shape.push_back("nodes");
    if (field.values_of_node > 1) shape.push_back(field.values_of_node);
    list.push_back({{"name", field.name},
                    {"unit", field.unit},
                    {"type", field.type},
                    {"shape", std::move(shape)}});
  }
  std::string text = nlohmann::ordered_json{{"fields", std::move(list)}}.dump();
  text.append((8 - text.size() % 8) % 8, ' ');
  std::string bytes = "TQSTATES";
  Append(bytes, std::uint32_t{kStatesVersion});
  Append(bytes, static_cast<std::uint32_t>(text.size()));
  return bytes + text;
}

nlohmann::json ToJson(const std::vector<double>& values, int values_of_node) {
  if (values_of_node == 1) return values;
  nlohmann::json nodes = nlohmann::json::array();
  for (std::size_t k = 0; k + 2 < values.size(); k += 3) {
    nodes.push_back({values[k], values[k + 1], values[k + 2]});
  }
  return nodes;
}

}  // namespace

StatesOutput::StatesOutput(const std::string& path, std::vector<StateField> fields,
                           StandardStreams& streams)
    : fields_(std::move(fields)), streams_(streams), binary_(path.ends_with(".bin")) {
  if (path != kStandardStream) file_.emplace(path);
  if (!binary_) return;
  file_->out() << Header(fields_);
  file_->KeepSoFar();
}

bool StatesOutput::Write(const StateRow& row) {
  if (!file_) return streams_.Write(AsJson(row));
  file_->out() << (binary_ ? AsBytes(row) : AsJson(row));
  // A disk failure ends the run, because no later row can be kept.
  if (!file_->KeepSoFar()) file_->Finish();
  return true;
}

void StatesOutput::Finish() {
  if (file_) file_->Finish();
}

std::string StatesOutput::AsJson(const StateRow& row) const {
  nlohmann::json line = nlohmann::json::object();
  for (const StateField& field : fields_) {
    line[field.name] = std::visit(
        [&field](const auto& value) -> nlohmann::json {
          using Value = std::decay_t<decltype(value)>;
          // Many readers of JSON lose digits of such large integers.
          if constexpr (std::is_same_v<Value, std::uint64_t>) return std::to_string(value);
          if constexpr (std::is_same_v<Value, std::vector<double>>) {
            return ToJson(value, field.values_of_node);
          }
          return value;
        },
        field.get(row));
  }
  return line.dump() + '\n';
}

std::string StatesOutput::AsBytes(const StateRow& row) const {
  std::string counts;
  std::string scalars;
  std::string nodes;
  for (const StateField& field : fields_) {
    const StateValue value = field.get(row);
    if (const auto* values = std::get_if<std::vector<double>>(&value)) {
      const std::size_t width = static_cast<std::size_t>(field.values_of_node);
      assert(values->size() % width == 0);
      Append(counts, std::uint64_t{values->size() / width});
      nodes.append(reinterpret_cast<const char*>(values->data()), 8 * values->size());
    } else {
      std::visit(
          [&scalars](const auto& one) {
            if constexpr (std::is_arithmetic_v<std::decay_t<decltype(one)>>) Append(scalars, one);
          },
          value);
    }
  }
  return counts + scalars + nodes;
}

}  // namespace torquer::program
