#include "client/report/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "client/report/settings.h"

namespace litags::report {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kHostile[] =
    "</title></style><script>alert(1)</script>\" onload='x' & <img src=//h>";

v1::ListCamerasResponse SomeCameras(int count, int width = 1600, int height = 1200) {
  v1::ListCamerasResponse cameras;
  cameras.mutable_up()->set_y(-1);
  for (int i = 0; i < count; ++i) {
    v1::NamedCamera* named = cameras.add_cameras();
    named->set_name(std::string(1, static_cast<char>('a' + i)) + ".png");
    named->mutable_camera()->set_width(width);
    named->mutable_camera()->set_height(height);
    for (int k = 0; k < 16; ++k) {
      named->mutable_camera()->mutable_viewmat()->add_values(k % 5 == 0 ? 1 : 0);
    }
  }
  return cameras;
}

ReportData Finished() {
  ReportData data;
  data.job.set_name("jobs/1");
  data.job.set_display_name("Hall");
  data.job.set_state(v1::JOB_STATE_SUCCEEDED);
  data.job.set_snapshot_iteration(40);
  data.job.mutable_options()->set_method(v1::METHOD_LITAGS);
  data.job.mutable_options()->set_seed(7);
  data.job.mutable_options()->set_iterations(40);
  data.job.mutable_options()->set_holdout_every(8);
  v1::JobReport* report = data.job.mutable_report();
  report->set_photos(9);
  report->set_registered(8);
  report->set_iterations(40);
  report->set_gaussians(12345);
  report->set_psnr_holdout(21.5);
  report->set_ssim_holdout(0.8125);
  v1::MethodInfo* method = data.server.add_methods();
  method->set_method(v1::METHOD_LITAGS);
  *method->mutable_defaults() = data.job.options();
  method->mutable_defaults()->set_iterations(15000);
  method->mutable_defaults()->set_seed(0);
  data.server.set_version("1.2.3");
  data.cameras = SomeCameras(8);
  data.pictures = PicturesOf(data.job, data.cameras);
  for (Picture& picture : data.pictures) picture.view.set_data("\xff\xd8\xff jpeg");
  return data;
}

TEST(Report, NumbersOfItsCommandMeanWhatTheJobHad) {
  ReportData data = Finished();
  for (const double share : {1.0 / 3, 0.123456789, 0.9, 1.0}) {
    data.job.mutable_options()->set_min_registered(share);
    const std::string text = OptionText(data.job.options(), "min_registered");
    EXPECT_EQ(std::stod(text), share) << text;
    EXPECT_LE(text.size(), 18u);
    EXPECT_THAT(ReportHtml(data), HasSubstr("--min-registered " + text));
  }
}

// Every text that a user can choose.
ReportData Hostile() {
  ReportData data = Finished();
  data.job.set_display_name(kHostile);
  data.job.set_owner(kHostile);
  (*data.job.mutable_labels())["site"] = kHostile;
  data.job.mutable_report()->add_dropped(kHostile);
  data.job.mutable_report()->add_notes(absl::StrCat(kHostile, " is left out: ", kHostile));
  data.job.mutable_report()->add_notes(kHostile);
  data.job.mutable_report()->set_sfm_preparation(kHostile);
  for (auto& named : *data.cameras.mutable_cameras()) named.set_name(kHostile);
  for (Picture& picture : data.pictures) picture.request.mutable_pose()->set_camera(kHostile);
  return data;
}

TEST(Report, NamesOfUsersStayText) {
  for (const v1::JobState state : {v1::JOB_STATE_SUCCEEDED, v1::JOB_STATE_FAILED}) {
    ReportData data = Hostile();
    data.job.set_state(state);
    data.job.mutable_error()->set_message(kHostile);
    data.job.mutable_error()->mutable_detail()->set_reason(kHostile);
    const std::string html = ReportHtml(data);
    EXPECT_THAT(html, HasSubstr("&lt;script&gt;"));
    EXPECT_THAT(html, Not(HasSubstr("<script")));
    EXPECT_THAT(html, Not(HasSubstr("\" onload")));
    EXPECT_THAT(html, Not(HasSubstr("<img src=/")));
    EXPECT_EQ(html.find("</style>"), html.rfind("</style>"));
  }
}

TEST(Report, ItSaysWhatAResultIsComparedBy) {
  const std::string html = ReportHtml(Finished());
  for (const char* part :
       {"Hall", "21.50 dB", "0.8125", "8 of 9", "12,345", "litags 1.2.3", "succeeded",
        "--method litags --iterations 40 --seed 7",
        "data:image/jpeg;base64,/9j/IGpwZWc=", "the service hands out no photos"}) {
    EXPECT_THAT(html, HasSubstr(part));
  }
}

TEST(Report, TheCurveEndsAtWhatTheReportSays) {
  ReportData data = Finished();
  v1::JobEvent event;
  event.mutable_progress()->set_iteration(30);
  event.mutable_progress()->set_loss(0.5);
  event.mutable_progress()->set_psnr_holdout(20);
  data.course.Add(event);
  EXPECT_THAT(ReportHtml(data), HasSubstr("PSNR of held-out photos: 21.5 dB at iteration 40"));
  EXPECT_THAT(ReportHtml(data), HasSubstr("On these, the PSNR"));
  data.job.clear_report();  // before the end not all of them are scored
  EXPECT_THAT(ReportHtml(data),
              HasSubstr("On these, or on 16 of them if there are more, the PSNR"));
}

TEST(Report, AFailedJobSaysWhyAndHasNoPictures) {
  ReportData data;
  data.job.set_name("jobs/1");
  data.job.set_state(v1::JOB_STATE_FAILED);
  data.job.mutable_error()->set_message("cameras for 2 of 40 photos");
  data.job.mutable_error()->mutable_detail()->set_reason("SFM_TOO_FEW_VIEWS");
  const std::string html = ReportHtml(data);
  EXPECT_FALSE(HasScene(data.job));
  EXPECT_THAT(html, HasSubstr("cameras for 2 of 40 photos (SFM_TOO_FEW_VIEWS)"));
  EXPECT_THAT(html, HasSubstr("jobs/1"));  // for want of a title
  EXPECT_THAT(html, Not(HasSubstr("<img")));
}

TEST(Report, AJobThatRunsIsNotTakenForADoneOne) {
  ReportData data = Finished();
  data.job.set_state(v1::JOB_STATE_RUNNING);
  EXPECT_THAT(ReportHtml(data), HasSubstr("had not ended"));
  EXPECT_THAT(ReportHtml(Finished()), Not(HasSubstr("had not ended")));
}

TEST(Report, OfAJobThatIsTrainedFurtherItShowsTheNewNumbers) {
  ReportData data = Finished();
  data.job.set_state(v1::JOB_STATE_RUNNING);
  EXPECT_THAT(ReportHtml(data), HasSubstr("<dd>40</dd>"));  // its scene is still the finished one
  data.job.set_snapshot_iteration(60);
  data.job.mutable_progress()->set_iteration(65);
  data.job.mutable_progress()->set_psnr_holdout(22.25);
  const std::string html = ReportHtml(data);
  EXPECT_THAT(html, HasSubstr("<dd>65</dd>"));
  EXPECT_THAT(html, HasSubstr("22.25 dB"));
  EXPECT_THAT(html, Not(HasSubstr("0.8125")));
  EXPECT_THAT(html, HasSubstr("8 of 9"));
}

TEST(Report, ItSaysFromWhichIterationsItsPicturesAre) {
  ReportData data = Finished();
  for (Picture& picture : data.pictures) picture.view.set_iteration(40);
  EXPECT_THAT(ReportHtml(data), HasSubstr("scene at iteration 40."));
  data.pictures[1].view.set_iteration(50);
  EXPECT_THAT(ReportHtml(data), HasSubstr("scene at iterations 40 to 50."));
}

TEST(Report, AVideoIsNotNoPhotos) {
  ReportData data = Finished();
  data.job.set_bytes(312'000'000);
  EXPECT_THAT(ReportHtml(data), HasSubstr("a video, "));
  data.job.set_photos(9);
  EXPECT_THAT(ReportHtml(data), HasSubstr("9 photos, "));
}

TEST(Report, PicturesArePairsFromPlacesFarApart) {
  v1::Job job;
  job.set_name("jobs/1");
  const std::vector<Picture> pictures = PicturesOf(job, SomeCameras(9));
  ASSERT_EQ(pictures.size(), 6u);
  EXPECT_EQ(pictures[0].request.pose().camera(), "b.png");
  EXPECT_EQ(pictures[5].request.pose().camera(), "h.png");
  EXPECT_EQ(pictures[0].request.settings().channel(), v1::CHANNEL_ORIGINAL);
  EXPECT_EQ(pictures[1].request.settings().channel(), v1::CHANNEL_COLOR);
  EXPECT_EQ(pictures[0].request.settings().width(), 800);
  EXPECT_EQ(PicturesOf(job, SomeCameras(2)).size(), 4u);
  EXPECT_EQ(PicturesOf(job, {}).size(), 0u);
}

TEST(Report, UprightAndSmallPicturesKeepTheirSize) {
  EXPECT_EQ(PicturesOf({}, SomeCameras(1, 900, 1200))[0].request.settings().height(), 800);
  EXPECT_EQ(PicturesOf({}, SomeCameras(1, 64, 48))[0].request.settings().width(), 64);
}

TEST(Report, AMethodWithOneLightHasOnePictureFromEachPlace) {
  ReportData data = Finished();
  data.job.mutable_options()->set_method(v1::METHOD_3DGS);
  data.pictures = PicturesOf(data.job, data.cameras);
  ASSERT_EQ(data.pictures.size(), 3u);
  EXPECT_THAT(ReportHtml(data), HasSubstr("one light only"));
}

}  // namespace
}  // namespace litags::report
