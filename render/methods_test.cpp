// SPDX-License-Identifier: Apache-2.0
#include "render/methods.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "schemas/error.h"

namespace raystage {
namespace {

TEST(Methods, AreFoundByNameAndTheirOptionsAreSound) {
  std::set<std::string_view> names;
  for (const Method* method : methods()) {
    EXPECT_TRUE(names.insert(method->name()).second) << method->name();
    EXPECT_EQ(&method_named(method->name()), method);
    std::set<std::string_view> options;
    for (const OptionSpec& option : method->options()) {
      EXPECT_TRUE(options.insert(option.name).second) << method->name() << ' ' << option.name;
      EXPECT_FALSE(option.help.empty()) << method->name() << ' ' << option.name;
    }
    // What is so unless given must itself be allowed.
    const MethodOptions fallbacks(method->options(), {}, method->name());
    EXPECT_NO_THROW(MethodOptions(method->options(), fallbacks.values(), method->name()))
        << method->name();
    for (const MethodPreset& preset : method->presets()) {
      const OptionValues values = options_from_text(preset.options);
      EXPECT_FALSE(values.empty()) << method->name() << ' ' << preset.name;
      EXPECT_NO_THROW(MethodOptions(method->options(), values, method->name())) << preset.options;
    }
  }
  EXPECT_THROW(method_named("focal"), Error);
}

TEST(Methods, AreDescribed) {
  const std::string text = describe_methods();
  EXPECT_THAT(text, ::testing::HasSubstr("\nfocal_plane = three cameras a ray"));
  EXPECT_THAT(text, ::testing::HasSubstr("\n    preset fast: step_px=2,aggregation=box"));
  int presets = 0;
  for (const Method* method : methods()) {
    for (const MethodPreset& preset : method->presets()) {
      ++presets;
      EXPECT_THAT(text, ::testing::HasSubstr(std::string(preset.options))) << method->name();
    }
  }
  EXPECT_GT(presets, 0);
}

}  // namespace
}  // namespace raystage
