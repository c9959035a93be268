// SPDX-License-Identifier: Apache-2.0
#include "compose/geometry/textures.h"

#include <utility>

#include "base/error.h"
#include "base/module_file.h"
#include "images/image_session.h"

namespace raystage::compose {
namespace {

OpenTextureLookup* load_texture_module() {
  return reinterpret_cast<OpenTextureLookup*>(
      load_module(kTextureModule, kOpenTextureLookup, "textures cannot be read"));
}

Error no_texture(const std::filesystem::path& file) {
  return Error::bad_input("the texture file does not exist", file.string(), "Correct the path");
}

}  // namespace

Textures::Textures(std::size_t cache_bytes, std::size_t image_bytes,
                   const Eigen::Matrix3f& working_from_rec709)
    : cache_bytes_(cache_bytes),
      image_bytes_(image_bytes),
      working_from_rec709_(working_from_rec709) {}

Textures::~Textures() = default;

Textures::Handle Textures::open(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) throw no_texture(file);
  return open_by(file.string(), sandbox::only_file(file));
}

Textures::Handle Textures::open(const ContainedPath& file) {
  if (!exists(file)) throw no_texture(file.path());
  return open_by(file.path().string(), sandbox::only_file(file));
}

Textures::Handle Textures::open_by(const std::string& name, const sandbox::OpenFile& open_file) {
  load_lookup([&](images::ImageSession& session) { session.start_for(name, open_file); });
  return lookup_->open(name, open_file);
}

Textures::Handle Textures::open(std::shared_ptr<const EmbeddedImage> image) {
  load_lookup([&](images::ImageSession& session) { session.start_for_bytes(image->bytes); });
  for (const auto& known : images_) {
    if (known->name == image->name)
      return lookup_->open_bytes(known->name, known->format, known->bytes);
  }
  images_.push_back(std::move(image));
  const EmbeddedImage& kept = *images_.back();
  return lookup_->open_bytes(kept.name, kept.format, kept.bytes);
}

void Textures::load_lookup(const std::function<void(images::ImageSession&)>& start) {
  if (lookup_) return;
  session_ = std::make_unique<images::ImageSession>(image_bytes_);
  start(*session_);  // its process starts while the module is loaded
  lookup_.reset(load_texture_module()(*session_, cache_bytes_));
}

}  // namespace raystage::compose
