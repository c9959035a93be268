// SPDX-License-Identifier: Apache-2.0
#include "render/common/method_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <stdexcept>

#include "base/error.h"

namespace raystage::render {
namespace {

constexpr std::array kSpecs{
    renamed_option("sub_plane_before", flag_option("sub_plane", true, "between planes")),
    integer_option("planes", 0, 0, 4096, "how many; 0: eq. 2.1"),
    number_option("f_number", 2.8, 0.1, 64, "focal length over aperture"),
    choice_option("shape", "round", "round|hexagon", "of the aperture"),
    text_option("proxy", "", "mesh file")};

std::string refusal(const schemas::OptionValues& given) {
  try {
    const MethodOptions options(kSpecs, given, "method aperture");
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(MethodOptions, UnlessGivenAreAsDeclared) {
  const MethodOptions options(kSpecs, {}, "here");
  EXPECT_TRUE(options.flag("sub_plane"));
  EXPECT_EQ(options.integer("planes"), 0);
  EXPECT_EQ(options.number("f_number"), 2.8);
  EXPECT_EQ(options.text("shape"), "round");
  EXPECT_EQ(options.text("proxy"), "");
  EXPECT_EQ(options.values().size(), kSpecs.size());
}

TEST(MethodOptions, TakesWhatIsGiven) {
  const MethodOptions options(kSpecs,
                              {{"sub_plane", false},
                               {"planes", 96.0},
                               {"f_number", 64.0},
                               {"shape", "hexagon"},
                               {"proxy", 7.0}},
                              "here");
  EXPECT_FALSE(options.flag("sub_plane"));
  EXPECT_EQ(options.integer("planes"), 96);
  EXPECT_EQ(options.number("f_number"), 64);
  EXPECT_EQ(options.text("shape"), "hexagon");
  EXPECT_EQ(options.text("proxy"), "7");
}

TEST(MethodOptions, RefusesWhatIsNotAllowedAndSaysWhatIs) {
  using ::testing::HasSubstr;
  EXPECT_THAT(refusal({{"plains", 3.0}}), HasSubstr("no option 'plains'"));
  EXPECT_THAT(refusal({{"planes", 2.5}}), HasSubstr("a whole number from 0 to 4096"));
  EXPECT_THAT(refusal({{"planes", -1.0}}), HasSubstr("found -1"));
  EXPECT_THAT(refusal({{"planes", "many"}}), HasSubstr("found 'many'"));
  EXPECT_THAT(refusal({{"f_number", 65.0}}), HasSubstr("a number from 0.1 to 64"));
  EXPECT_THAT(refusal({{"f_number", true}}), HasSubstr("found true"));
  EXPECT_THAT(refusal({{"sub_plane", 1.0}}), HasSubstr("true or false"));
  EXPECT_THAT(refusal({{"shape", "square"}}), HasSubstr("round, hexagon"));
  EXPECT_THAT(refusal({{"shape", "roun"}}), HasSubstr("round, hexagon"));
  EXPECT_EQ(refusal({{"shape", "round"}}), "");
}

TEST(MethodOptions, AskingForWhatWasNeverDeclaredIsABrokenInvariant) {
  const MethodOptions options(kSpecs, {}, "here");
  EXPECT_THROW(options.number("plains"), std::logic_error);
  EXPECT_THROW(options.number("sub_plane"), std::logic_error);
}

TEST(MethodOptions, ComeFromTheCommandLine) {
  EXPECT_EQ(option_from_text("planes=96"), (schemas::OptionValues::value_type{"planes", 96.0}));
  EXPECT_EQ(option_from_text("sub_plane=false"),
            (schemas::OptionValues::value_type{"sub_plane", false}));
  EXPECT_EQ(option_from_text("shape=hexagon"),
            (schemas::OptionValues::value_type{"shape", std::string("hexagon")}));
  EXPECT_EQ(option_from_text("proxy=a=b"),
            (schemas::OptionValues::value_type{"proxy", std::string("a=b")}));
  EXPECT_EQ(option_from_text("proxy="),
            (schemas::OptionValues::value_type{"proxy", std::string()}));
  EXPECT_EQ(option_from_text("f_number=1e999").second, schemas::OptionValue(std::string("1e999")));
  EXPECT_THROW(option_from_text("planes"), Error);
  EXPECT_THROW(option_from_text("=3"), Error);
}

TEST(MethodOptions, ComeAsAListAndGoBack) {
  const schemas::OptionValues values =
      options_from_text("planes=96,shape=hexagon,sub_plane=true,step=0.25");
  EXPECT_EQ(values, (schemas::OptionValues{{"planes", 96.0},
                                           {"shape", std::string("hexagon")},
                                           {"sub_plane", true},
                                           {"step", 0.25}}));
  EXPECT_EQ(options_to_text(values), "planes=96,shape=hexagon,step=0.25,sub_plane=true");
  EXPECT_EQ(options_from_text(options_to_text(values)), values);
  EXPECT_TRUE(options_from_text("").empty());
  EXPECT_EQ(options_to_text({}), "");
  for (const char* text : {"planes", "planes=1,,step=2", "planes=1,planes=2"}) {
    EXPECT_THROW(options_from_text(text), Error) << text;
  }
}

TEST(MethodOptions, AreDescribedWithRangeAndFallback) {
  EXPECT_EQ(describe_option(kSpecs[1]),
            "planes = 0 (a whole number from 0 to 4096): how many; 0: eq. 2.1");
  EXPECT_EQ(describe_option(kSpecs[3]), "shape = 'round' (round, hexagon): of the aperture");
  EXPECT_EQ(describe_option(kSpecs[4]), "proxy (text): mesh file");
}

TEST(MethodOptions, AcceptFormerNamesAlone) {
  const MethodOptions options(kSpecs, {{"sub_plane_before", false}}, "the test");
  EXPECT_FALSE(options.flag("sub_plane"));
  EXPECT_FALSE(options.values().contains("sub_plane_before"));
  EXPECT_EQ(kSpecs[0].fingerprint_name(), "sub_plane_before");
  EXPECT_THAT(refusal({{"sub_plane", true}, {"sub_plane_before", false}}),
              ::testing::HasSubstr("is the former name of 'sub_plane'"));
}

}  // namespace
}  // namespace raystage::render
