// Options of a job: that the proto's are the engine's.
#include <gtest/gtest.h>

#include <cctype>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "server/api/convert.h"
#include "server/testing/api_fixture.h"

namespace litags {
namespace {

class OptionsApi : public ApiTest {};

TEST_F(OptionsApi, DefaultsOfProtoAndEngineAreTheSame) {
  v1::Job job;
  ASSERT_TRUE(client_.Create({}, &job).ok());
  EXPECT_EQ(job.state(), v1::JOB_STATE_UPLOADING);
  const v1::JobOptions expected = OptionsToProto(ReconstructOptions());
  EXPECT_EQ(job.options().SerializeAsString(), expected.SerializeAsString());
  // Every field of the message is set, so each one has a counterpart in the engine.
  std::vector<const google::protobuf::FieldDescriptor*> set;
  expected.GetReflection()->ListFields(expected, &set);
  EXPECT_EQ(static_cast<int>(set.size()), v1::JobOptions::descriptor()->field_count());
}

TEST_F(OptionsApi, EveryOptionReachesTheEngineAndComesBack) {
  v1::CreateJobRequest request;
  v1::JobOptions* o = request.mutable_options();
  o->set_method(v1::METHOD_3DGS);
  o->set_tone(v1::TONE_PAPER);
  o->set_white_balance(v1::WHITE_BALANCE_CAMERA);
  o->set_iterations(123);
  o->set_seed(~uint64_t{0});
  o->set_threads(3);
  o->set_max_gaussians(5000);
  o->set_sh_degree(1);
  o->set_max_image_side(640);
  o->set_holdout_every(5);
  o->set_min_registered(0.75);
  o->set_checkpoint_every(11);
  o->set_preview_every(12);
  o->set_depth_source(v1::DEPTH_SOURCE_STEREO);
  o->set_schedule_iterations(100);
  o->set_frames(20);
  o->set_refine_cameras(true);
  v1::Job job;
  const grpc::Status status = client_.Create(request, &job);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(job.options().ShortDebugString(), o->ShortDebugString());
}

TEST_F(OptionsApi, OptionOutOfRangeNamesTheField) {
  v1::CreateJobRequest request;
  request.mutable_options()->set_min_registered(1.5);
  v1::Job job;
  grpc::Status status = client_.Create(request, &job);
  EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(DetailOf(status).field, "options.min_registered");
  request.mutable_options()->clear_min_registered();
  request.mutable_options()->set_method(static_cast<v1::Method>(77));
  EXPECT_REFUSED(client_.Create(request, &job), INVALID_ARGUMENT, "OPTION_OUT_OF_RANGE",
                 "options.method");
  request.mutable_options()->clear_method();
  request.mutable_options()->set_depth_source(static_cast<v1::DepthSource>(6));
  EXPECT_REFUSED(client_.Create(request, &job), INVALID_ARGUMENT, "OPTION_OUT_OF_RANGE",
                 "options.depth_source");
}

// Enums of the proto have the engine's values plus 1, and the words of the command line.
TEST(JobOptions, EnumsOfProtoAndEngineAreTheSame) {
  const ReconstructOptions options;
  int enums = 0;
  const auto check = [&]<class E>(const char* name, const E&) {
    const auto& type = *v1::JobOptions::descriptor()->FindFieldByName(name)->enum_type();
    EXPECT_EQ(type.value_count() - 1, static_cast<int>(std::size(EnumWords<E>::kWords))) << name;
    for (const auto& [value, word] : EnumWords<E>::kWords) {
      const auto* known = type.FindValueByNumber(static_cast<int>(value) + 1);
      ASSERT_NE(known, nullptr) << name << " " << word;
      const size_t prefix = type.value(0)->name().size() - std::string("UNSPECIFIED").size();
      std::string want = known->name().substr(prefix);
      for (char& c : want) c = c == '_' ? '-' : static_cast<char>(std::tolower(c));
      EXPECT_EQ(word, want);
    }
    ++enums;
  };
  VisitFields(FieldsOf<ReconstructOptions>(), options,
              [&]<class T>(const char* name, const T& value, const FieldRule&) {
                if constexpr (std::is_enum_v<T>) check(name, value);
                if constexpr (IsOptional<T>::value) check(name, typename T::value_type());
              });
  EXPECT_EQ(enums, 4);
}

// As `litags-train --method` and the table have it: the name alone decides the recipe.
TEST(JobOptions, AMethodIsItsRecipe) {
  const std::pair<v1::Method, Recipe> methods[] = {{v1::METHOD_LITAGS, Litags()},
                                                   {v1::METHOD_LITAGS_PAPER, LitagsPaper()},
                                                   {v1::METHOD_3DGS, Plain3dgs()}};
  for (const auto& [method, recipe] : methods) {
    v1::JobOptions proto;
    proto.set_method(method);
    const auto options = OptionsFromProto(proto);
    ASSERT_TRUE(options.ok()) << options.status();
    EXPECT_EQ(FieldsText(options->ResolveRecipe()), FieldsText(recipe)) << v1::Method_Name(method);
  }
}

}  // namespace
}  // namespace litags
