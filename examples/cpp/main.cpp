// Classify a prepared mesh with onnxruntime; see docs/any-runtime.md.
//
//     any_runtime WHOLE.onnx MESH.off

#include <onnxruntime_cxx_api.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <numeric>
#include <sstream>
#include <string>
#include <vector>

struct Mesh {
  std::vector<float> vertices;      // V x 3
  std::vector<std::int64_t> faces;  // F x 3
};

Mesh read_off(const char* path) {
  std::ifstream file(path);
  std::string word;
  std::size_t vertices = 0, faces = 0, corners;
  file >> word >> vertices >> faces >> word;
  Mesh mesh{std::vector<float>(3 * vertices), std::vector<std::int64_t>(3 * faces)};
  for (float& number : mesh.vertices) file >> number;
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    if (i % 3 == 0) file >> corners;
    file >> mesh.faces[i];
  }
  if (!file) throw std::runtime_error(std::string(path) + " is no OFF file of triangles");
  return mesh;
}

// The names in the array "classes" of the card, which is JSON.
std::vector<std::string> read_classes(const std::string& card) {
  std::istringstream names(card.substr(card.find('[', card.find("\"classes\"")) + 1));
  std::vector<std::string> classes;
  for (std::string name; names >> std::ws && names.peek() == '"'; names.ignore()) {  // a comma, or the end
    names >> std::quoted(name);
    classes.push_back(name);
  }
  return classes;
}

template <typename Number>
Ort::Value rows_of_3(std::vector<Number>& numbers) {
  const auto memory = Ort::MemoryInfo::CreateCpu(OrtArenaAllocator, OrtMemTypeDefault);
  const std::array<std::int64_t, 2> shape{static_cast<std::int64_t>(numbers.size() / 3), 3};
  return Ort::Value::CreateTensor<Number>(memory, numbers.data(), numbers.size(), shape.data(), 2);
}

int main(int count, char** arguments) try {
  if (count != 3) throw std::runtime_error("usage: any_runtime WHOLE.onnx MESH.off");
  Mesh mesh = read_off(arguments[2]);
  Ort::Env env;
  Ort::Session session(env, arguments[1], Ort::SessionOptions());

  const std::array<const char*, 2> inputs{"vertices", "faces"};
  const std::array<const char*, 1> outputs{"scores"};  // or evidence, novelty, embedding
  const std::array<Ort::Value, 2> values{rows_of_3(mesh.vertices), rows_of_3(mesh.faces)};
  const auto found = session.Run({}, inputs.data(), values.data(), 2, outputs.data(), 1);
  const float* scores = found[0].GetTensorData<float>();

  Ort::AllocatorWithDefaultOptions allocator;
  const auto card = session.GetModelMetadata().LookupCustomMetadataMapAllocated("meshconv3d.config", allocator);
  const std::vector<std::string> classes = read_classes(card.get());
  std::vector<std::size_t> order(classes.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](auto a, auto b) { return scores[a] > scores[b]; });
  order.resize(std::min<std::size_t>(order.size(), 3));
  for (const std::size_t i : order) std::cout << classes[i] << ' ' << scores[i] << '\n';
  return 0;
} catch (const std::exception& error) {
  std::cerr << error.what() << '\n';
  return 1;
}
