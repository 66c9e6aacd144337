#include "client/report/report.h"

#include <algorithm>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/report/cameras.h"
#include "client/report/chart.h"
#include "client/report/html.h"
#include "client/report/settings.h"
#include "client/report/style.h"
#include "client/report/text.h"

namespace litags::report {
namespace {

// As many pairs as fit on a printed page beside the numbers; each is some 50 kB.
constexpr int kPlaces = 3;
// Enough for half of a page's width on screens of twice the density.
constexpr int kPictureSide = 800;
constexpr int kJpegQuality = 85;

bool HasOneLight(const v1::Job& job) { return job.options().method() == v1::METHOD_3DGS; }

std::string TitleOf(const v1::Job& job) {
  return job.display_name().empty() ? job.name() : job.display_name();
}

std::string DecibelText(double value) { return absl::StrFormat("%.2f dB", value); }

std::string TimeInUtc(const google::protobuf::Timestamp& time) {
  const std::string text = TimeText(time);
  return text.empty() ? "" : text + " UTC";
}

Html Heading(const v1::Job& job) {
  const std::string state = StateText(job.state());
  Html head = El("div", {{"class", "head"}},
                 {El("h1", {}, {TitleOf(job)}),
                  El("span", {{"class", absl::StrCat("state ", state)}}, {state})});
  if (job.state() == v1::JOB_STATE_FAILED) {
    head += El("p", {{"class", "error"}},
               {job.error().message(), " (", job.error().detail().reason(), ")"});
  }
  if (!HasEnded(job.state())) {
    head += El("p", {}, {"The job had not ended when this report was made."});
  }
  return head;
}

// What is looked at first.
Html KeyFacts(const v1::Job& job) {
  const v1::JobReport& report = job.report();
  const v1::Progress& progress = job.progress();
  // While a finished job is trained further, what is shown is a newer scene than the report's.
  const bool done = job.has_report() && job.snapshot_iteration() == report.iterations();
  std::string psnr;
  if (done ? report.has_psnr_holdout() : progress.has_psnr_holdout()) {
    psnr = DecibelText(done ? report.psnr_holdout() : progress.psnr_holdout());
  }
  const std::string ssim =
      done && report.has_ssim_holdout() ? absl::StrFormat("%.4f", report.ssim_holdout()) : "";
  const std::string placed =
      job.has_report() ? absl::StrCat(report.registered(), " of ", report.photos()) : "";
  const int64_t gaussians = done ? report.gaussians() : progress.gaussians();
  return El(
      "dl", {{"class", "facts"}},
      {Fact("PSNR of held-out photos", psnr), Fact("SSIM of held-out photos", ssim),
       Fact("Photos placed", placed), Fact("Gaussians", gaussians > 0 ? CountText(gaussians) : ""),
       Fact("Iterations", CountText(done ? report.iterations() : progress.iteration())),
       Fact("Time of the run", done ? DurationText(SecondsOf(report.run_time())) : ""),
       Fact("Method", OptionText(job.options(), "method")),
       Fact("Seed", OptionText(job.options(), "seed"))});
}

std::string DataUrl(const std::string& jpeg) {
  return absl::StrCat("data:image/jpeg;base64,", absl::Base64Escape(jpeg));
}

Html PictureOf(const Picture& picture, const std::string& words) {
  const std::string alt = absl::StrCat(picture.request.pose().camera(), ", ", words);
  return El("div", {},
            {El("img", {{"src", DataUrl(picture.view.data())},
                        {"alt", alt},
                        {"width", absl::StrCat(picture.view.width())},
                        {"height", absl::StrCat(picture.view.height())}}),
             El("p", {}, {words})});
}

// One figure for each place; its pictures follow each other.
Html PicturesSection(const std::vector<Picture>& pictures, bool one_light) {
  if (pictures.empty()) return {};
  Html figures;
  const auto [oldest, newest] = std::minmax_element(
      pictures.begin(), pictures.end(),
      [](const Picture& a, const Picture& b) { return a.view.iteration() < b.view.iteration(); });
  const int first = oldest->view.iteration(), last = newest->view.iteration();
  for (size_t i = 0; i < pictures.size(); i += one_light ? 1 : 2) {
    const std::string& camera = pictures[i].request.pose().camera();
    Html inside = PictureOf(pictures[i], one_light ? "as learnt" : "before: the photos' light");
    if (!one_light) inside += PictureOf(pictures[i + 1], "after: normally lit");
    inside += El("figcaption", {}, {"From where ", camera, " was taken"});
    figures += El("figure", {{"class", "pair"}}, {inside});
  }
  const std::string note = absl::StrCat(
      "All are renderings of the scene at iteration",
      first == last ? absl::StrCat(" ", last) : absl::StrCat("s ", first, " to ", last),
      one_light ? "; this method learns one light only."
                : ". \"Before\" is the scene in the light of the photos, not the photo itself: "
                  "the service hands out no photos.");
  return El("section", {},
            {El("h2", {}, {one_light ? "Pictures" : "Before and after"}), figures,
             El("p", {{"class", "quiet"}}, {note})});
}

// Measured while training, and at its end.
std::vector<CurvePoint> PsnrCurve(const Course& course, const v1::JobReport& report) {
  std::vector<CurvePoint> curve = course.psnr();
  const auto last = static_cast<double>(report.iterations());
  if (report.has_psnr_holdout() && (curve.empty() || curve.back().iteration < last)) {
    curve.push_back({last, course.run_seconds(), report.psnr_holdout()});
  }
  return curve;
}

// Of a loss the first few values are far off; the end of the curve is what is looked at.
constexpr double kShownOfLoss = 0.98;

Html CurvesSection(const Course& course, const v1::Job& job) {
  if (course.loss().empty()) return {};
  const std::vector<CurvePoint> psnr = PsnrCurve(course, job.report());
  Html section = El("h2", {}, {"Loss and quality"});
  section += El("div", {{"class", "charts"}},
                {Chart("Loss", "", course.loss(), kShownOfLoss),
                 Chart("PSNR of held-out photos", "dB", psnr)});
  section += El("p", {{"class", "quiet"}},
                {"Over iterations; below them, the time that the job had run by then."});
  if (!psnr.empty()) {
    const bool of_all =
        job.has_report() && psnr.back().iteration == static_cast<double>(job.report().iterations());
    section += El("p", {},
                  {absl::StrFormat("One photo of every %d, in the order of their names, was "
                                   "kept out of training. On these%s, the PSNR to the normally "
                                   "lit target was %.2f dB at iteration %.0f.",
                                   job.options().holdout_every(),
                                   of_all ? "" : ", or on 16 of them if there are more",
                                   psnr.back().value, psnr.back().iteration)});
  }
  return El("section", {}, {section});
}

Html StagesSection(const std::vector<StageTime>& stages) {
  double longest = 1e-9;
  for (const StageTime& stage : stages) longest = std::max(longest, stage.seconds);
  Html rows;
  for (const StageTime& stage : stages) {
    const std::string width = absl::StrFormat("width: %.1f%%", 100 * stage.seconds / longest);
    rows +=
        El("tr", {},
           {El("th", {{"scope", "row"}}, {stage.name}), El("td", {}, {DurationText(stage.seconds)}),
            El("td", {}, {El("div", {{"class", "bar"}, {"style", width}})})});
  }
  if (stages.empty()) return {};
  return El("section", {},
            {El("h2", {}, {"Time of each stage"}), El("table", {{"class", "stages"}}, {rows})});
}

Html NotesSection(const std::vector<std::string>& notes) {
  if (notes.empty()) return {};
  Html items;
  for (const std::string& note : notes) items += El("li", {}, {note});
  return El("section", {}, {El("h2", {}, {"Notes"}), El("ul", {}, {items})});
}

Html OriginSection(const ReportData& data) {
  const v1::Job& job = data.job;
  return El(
      "section", {},
      {El("h2", {}, {"Where it comes from"}),
       El("dl", {},
          {Fact("Job", job.name()), Fact("Owner", job.owner()), Fact("Labels", LabelsText(job)),
           Fact("Files", absl::StrCat(IsOfVideo(job) ? "a video" : Counted(job.photos(), "photo"),
                                      ", ", BytesText(job.bytes()))),
           Fact("Created", TimeInUtc(job.create_time())),
           Fact("Started", TimeInUtc(job.start_time())), Fact("Ended", TimeInUtc(job.end_time())),
           Fact("Runs since it was last started", absl::StrCat(job.attempt())),
           Fact("Server, when this was written", "litags " + data.server.version()),
           Fact("Report written", TimeInUtc(data.made))})});
}

Html Head(const std::string& title) {
  return El("head", {},
            {El("meta", {{"charset", "utf-8"}}),
             El("meta", {{"http-equiv", "Content-Security-Policy"},
                         {"content",
                          "default-src 'none'; img-src data:; style-src "
                          "'unsafe-inline'"}}),
             El("meta", {{"name", "viewport"}, {"content", "width=device-width"}}),
             El("title", {}, {title, " - litags"}), El("style", {}, {Html::Literal(kStyle)})});
}

}  // namespace

bool HasEnded(v1::JobState state) {
  return state == v1::JOB_STATE_SUCCEEDED || state == v1::JOB_STATE_FAILED ||
         state == v1::JOB_STATE_CANCELLED;
}

bool HasScene(const v1::Job& job) { return job.has_snapshot_iteration(); }

std::vector<Picture> PicturesOf(const v1::Job& job, const v1::ListCamerasResponse& cameras) {
  std::vector<Picture> pictures;
  const int count = std::min(kPlaces, cameras.cameras_size());
  for (int i = 0; i < count; ++i) {
    const v1::NamedCamera& named =
        cameras.cameras((2 * i + 1) * cameras.cameras_size() / (2 * count));
    Picture picture;
    picture.request.set_name(job.name());
    picture.request.mutable_pose()->set_camera(named.name());
    v1::RenderSettings* settings = picture.request.mutable_settings();
    settings->set_format(v1::PICTURE_FORMAT_JPEG);
    settings->set_jpeg_quality(kJpegQuality);
    const int width = named.camera().width(), height = named.camera().height();
    if (width >= height) settings->set_width(std::min(width, kPictureSide));
    if (width < height) settings->set_height(std::min(height, kPictureSide));
    settings->set_channel(v1::CHANNEL_ORIGINAL);
    if (!HasOneLight(job)) pictures.push_back(picture);
    settings->set_channel(v1::CHANNEL_COLOR);
    pictures.push_back(std::move(picture));
  }
  return pictures;
}

std::string ReportHtml(const ReportData& data) {
  std::vector<std::string> notes;
  const std::vector<LeftOut> left_out = PhotosLeftOut(data.job.report(), &notes);
  Html body = Heading(data.job);
  body += KeyFacts(data.job);
  body += PicturesSection(data.pictures, HasOneLight(data.job));
  body += CurvesSection(data.course, data.job);
  body += StagesSection(data.course.stages());
  if (data.job.has_report()) {
    body += CamerasSection(data.job.report(), left_out, data.cameras);
  }
  body += NotesSection(notes);
  body += SettingsSection(data.job.options(), data.server);
  body += OriginSection(data);
  const Html page = El("html", {{"lang", "en"}},
                       {Head(TitleOf(data.job)), El("body", {}, {El("main", {}, {body})})});
  return absl::StrCat("<!doctype html>\n", page.markup(), "\n");
}

}  // namespace litags::report
