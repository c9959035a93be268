// SPDX-License-Identifier: Apache-2.0
// raystage-apply-ocio, in lib/raystage: reads OpenColorIO configs and applies their transforms for
// its parent process, see sandbox/. The last config and transform are kept.
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "compose/color/color_requests.h"
#include "compose/color/ocio_config.h"
#include "sandbox/answer.h"
#include "sandbox/decoder_main.h"

namespace {

using namespace raystage;
using namespace raystage::compose;

class Configs {
 public:
  void answer(const ColorRequest& request, sandbox::ByteReader& rest, sandbox::ByteWriter& result) {
    const OcioConfig& config = config_of(request);
    switch (request.question) {
      case ColorQuestion::kDescription:
        return result.write_plain(config.description());
      case ColorQuestion::kInteropId:
        return result.write_plain(config.interop_id(request.names[0]));
      case ColorQuestion::kSpaceFromInteropId:
        return result.write_plain(config.space_from_interop_id(request.names[0]));
      case ColorQuestion::kProperties: {
        const OcioTransform& transform = transform_of(config, request);
        for (const bool flag :
             {transform.is_no_op(), transform.is_linear(), transform.is_matrix()}) {
          result.write(std::uint8_t{flag});
        }
        return result.write(transform.columns());
      }
      case ColorQuestion::kApply: {
        const int channels = rest.read<int>();
        std::vector<float> values;
        rest.read_plain(values);
        transform_of(config, request).apply(values, channels);
        return result.append(std::as_bytes(std::span(values)));
      }
    }
    throw std::runtime_error("it was asked for something unknown");
  }

 private:
  const OcioConfig& config_of(const ColorRequest& request) {
    std::pair key(request.file, request.rec709_name);
    if (!config_ || key != config_key_) {
      transform_.reset();
      config_ = OcioConfig::from_file(request.file, request.rec709_name);
      config_key_ = std::move(key);
    }
    return *config_;
  }
  const OcioTransform& transform_of(const OcioConfig& config, ColorRequest request) {
    request.question = {};
    if (!transform_ || request != transform_key_) {
      const auto& [first, second, third] = request.names;
      switch (request.kind) {
        case TransformKind::kToSpace:
          transform_ = config.to_space(first);
          break;
        case TransformKind::kFromSpace:
          transform_ = config.from_space(first);
          break;
        case TransformKind::kBetween:
          transform_ = config.between(first, second);
          break;
        case TransformKind::kToDisplay:
          transform_ = config.to_display(first, second, third);
          break;
      }
      transform_key_ = std::move(request);
    }
    return *transform_;
  }

  std::optional<OcioConfig> config_;
  std::pair<std::string, std::string> config_key_;
  std::optional<OcioTransform> transform_;
  ColorRequest transform_key_;
};

}  // namespace

int main(int argc, char** argv) {
  Configs configs;
  return sandbox::decoder_main(argc, argv, [&](std::span<const std::byte> bytes) {
    sandbox::ByteReader reader(bytes);
    const ColorRequest request = read_request(reader);
    return sandbox::answer_or_error(
        [&](sandbox::ByteWriter& result) { configs.answer(request, reader, result); });
  });
}
