// SPDX-License-Identifier: Apache-2.0
#include "schemas/fixity_catalogue.h"

#include "schemas/fields.h"

namespace raystage::schemas {
namespace {

using CatalogueCheck = FixityCatalogue::Check;
using CheckedCamera = FixityCatalogue::Camera;
using CheckCheckProgress = FixityCatalogue::Progress;
using CatalogueTake = FixityCatalogue::Take;

constexpr auto kFixityResultNames =
    enum_names<FixityCatalogue::Result>("intact", "not_closed", "damaged", "unreadable");

constexpr Fields kCatalogueCheck(required("finished_utc", &CatalogueCheck::finished_utc, kUtc),
                                 required("state", &CatalogueCheck::state),
                                 required("result", &CatalogueCheck::result, kFixityResultNames),
                                 required("problem_count", &CatalogueCheck::problem_count),
                                 required("problems", &CatalogueCheck::problems),
                                 required("bytes", &CatalogueCheck::bytes),
                                 required("seconds", &CatalogueCheck::seconds));

constexpr Fields kCheckedCamera(required("id", &CheckedCamera::id),
                                required("frames", &CheckedCamera::frames),
                                required("complete", &CheckedCamera::is_complete));

constexpr Fields kCheckProgress(required("started_utc", &CheckCheckProgress::started_utc, kUtc),
                                required("state", &CheckCheckProgress::state),
                                required("cameras", &CheckCheckProgress::cameras,
                                         list_with_ids(kCheckedCamera)));

constexpr Fields kCatalogue(required(
    "takes", &FixityCatalogue::takes,
    list_with_ids(Fields(required("id", &CatalogueTake::path),
                         optional("name", &CatalogueTake::name),
                         required("first_seen_utc", &CatalogueTake::first_seen_utc, kUtc),
                         optional("missing_since_utc", &CatalogueTake::missing_since_utc, kUtc),
                         optional("last_intact_utc", &CatalogueTake::last_intact_utc, kUtc),
                         optional("last_check", &CatalogueTake::last_check, kCatalogueCheck),
                         optional("progress", &CatalogueTake::progress, kCheckProgress)))));

}  // namespace

std::string_view name_of(FixityCatalogue::Result result) { return kFixityResultNames.name(result); }

FixityCatalogue parse_fixity_catalogue(std::string_view text, std::string_view name) {
  return parse_document_as<FixityCatalogue>("fixity_catalogue", kCatalogue, text, name);
}

std::string format_fixity_catalogue(const FixityCatalogue& catalogue) {
  return format_document("fixity_catalogue", kCatalogue, catalogue);
}

FixityCatalogue read_fixity_catalogue(const std::filesystem::path& file) {
  return parse_fixity_catalogue(read_file(file), file.string());
}

void write_fixity_catalogue(const FixityCatalogue& catalogue, const std::filesystem::path& file) {
  write_document(format_fixity_catalogue(catalogue), parse_fixity_catalogue, file);
}

}  // namespace raystage::schemas
