// A folder of badly lit photos becomes a picture in normal light, and a scene for viewers:
//
//	reconstruct night_photos/ view.png scene.ply     (docs/languages.md)
package main

import (
	"context"
	"crypto/rand"
	"crypto/sha256"
	"crypto/tls"
	"crypto/x509"
	"encoding/hex"
	"fmt"
	"io"
	"log"
	"net"
	"os"
	"path/filepath"
	"regexp"
	"strconv"
	"strings"
	"time"

	"google.golang.org/genproto/googleapis/rpc/errdetails"
	"google.golang.org/grpc"
	"google.golang.org/grpc/codes"
	"google.golang.org/grpc/credentials"
	"google.golang.org/grpc/keepalive"
	"google.golang.org/grpc/metadata"
	"google.golang.org/grpc/status"
	"google.golang.org/protobuf/proto"

	pb "litags/v1"
)

var ctx = context.Background()

// detailOf gives the service's reason and field of an error, for programs.
func detailOf(err error) (reason, field string) {
	for _, detail := range status.Convert(err).Details() {
		if known, ok := detail.(*pb.ErrorDetail); ok {
			return known.Reason, known.Field
		}
	}
	return "", ""
}

// must ends the program with what the service says.
func must[T any](result T, err error) T {
	if err != nil {
		if reason, field := detailOf(err); reason != "" {
			log.Println(reason, field)
		}
		log.Fatalln(err)
	}
	return result
}

// mayRetry says whether the same call may succeed later: the connection broke, or the server is busy.
func mayRetry(err error) bool {
	for _, detail := range status.Convert(err).Details() {
		if _, ok := detail.(*errdetails.RetryInfo); ok {
			return true
		}
	}
	return status.Code(err) == codes.Unavailable
}

var answered = false // a server that never did so is tried for a few seconds only

// persistently repeats a call that is safe to repeat.
func persistently(call func() error) error {
	for attempt := 1; ; attempt++ {
		err := call()
		answered = answered || status.Code(err) != codes.Unavailable
		if err == nil || !mayRetry(err) || attempt == 60 || (attempt == 5 && !answered) {
			return err
		}
		time.Sleep(time.Second)
	}
}

// again repeats all calls but streams. Those that make or start a job have a request_id: once more
// changes nothing.
func again(ctx context.Context, method string, request, reply any, channel *grpc.ClientConn,
	invoke grpc.UnaryInvoker, options ...grpc.CallOption) error {
	return persistently(func() error {
		return invoke(ctx, method, request, reply, channel, options...)
	})
}

func newID() string {
	id := make([]byte, 16)
	must(rand.Read(id))
	return hex.EncodeToString(id)
}

func isThisMachine(server string) bool {
	host, _, _ := net.SplitHostPort(server)
	return host == "localhost" || net.ParseIP(host).IsLoopback()
}

// connect takes the environment variables of the program litags.
func connect() *grpc.ClientConn {
	server, token := os.Getenv("LITAGS_SERVER"), os.Getenv("LITAGS_TOKEN")
	if server == "" {
		server = "127.0.0.1:50051"
	}
	if file := os.Getenv("LITAGS_TOKEN_FILE"); file != "" {
		token = strings.TrimSpace(string(must(os.ReadFile(file))))
	}
	security := grpc.WithInsecure()
	if config := tlsConfig(); config != nil {
		security = grpc.WithTransportCredentials(credentials.NewTLS(config))
	} else if token != "" && !isThisMachine(server) {
		log.Fatalln("the token would travel to", server, "unencrypted; set LITAGS_TLS=1 or LITAGS_TLS_CA")
	}
	if token != "" {
		ctx = metadata.AppendToOutgoingContext(ctx, "authorization", "Bearer "+token)
	}
	silence := 30 // seconds until a silent server is asked whether it is there
	if seconds := os.Getenv("LITAGS_KEEPALIVE"); seconds != "" {
		silence = must(strconv.Atoi(seconds))
	}
	return must(grpc.Dial(server, security, grpc.WithUnaryInterceptor(again),
		grpc.WithKeepaliveParams(keepalive.ClientParameters{
			Time: time.Duration(silence) * time.Second, Timeout: 10 * time.Second}),
		grpc.WithDefaultCallOptions(grpc.MaxCallRecvMsgSize(256<<20)))) // a picture may have more than 4 MiB
}

// tlsConfig is for a server with TLS; nil for one without.
func tlsConfig() *tls.Config {
	ca, name := os.Getenv("LITAGS_TLS_CA"), os.Getenv("LITAGS_TLS_NAME")
	certificate, key := os.Getenv("LITAGS_TLS_CERT"), os.Getenv("LITAGS_TLS_KEY")
	wanted := !regexp.MustCompile(`(?i)^(0|false|no|off)?$`).MatchString(os.Getenv("LITAGS_TLS"))
	if !wanted && ca+name+certificate+key == "" {
		return nil
	}
	config := &tls.Config{ServerName: name}
	if ca != "" { // else the system's authorities are trusted
		config.RootCAs = x509.NewCertPool()
		if !config.RootCAs.AppendCertsFromPEM(must(os.ReadFile(ca))) {
			log.Fatalln(ca, "holds no certificate (PEM)")
		}
	}
	if (certificate == "") != (key == "") {
		log.Fatalln("LITAGS_TLS_CERT and LITAGS_TLS_KEY belong together; set both")
	}
	if key != "" {
		config.Certificates = []tls.Certificate{must(tls.LoadX509KeyPair(certificate, key))}
	}
	return config
}

func upload(jobs pb.ReconstructionServiceClient, job, photo string) error {
	data, err := os.ReadFile(photo)
	if err != nil {
		return err
	}
	stream, err := jobs.UploadImages(ctx)
	if err != nil {
		return err
	}
	send := func(part *pb.UploadImagesRequest) { stream.Send(part) } // errors come with the answer
	send(&pb.UploadImagesRequest{Part: &pb.UploadImagesRequest_Name{Name: job}})
	sum := sha256.Sum256(data)
	send(&pb.UploadImagesRequest{Part: &pb.UploadImagesRequest_File{File: &pb.FileHeader{
		FileName: filepath.Base(photo), SizeBytes: int64(len(data)), Sha256: sum[:]}}})
	for chunk := 256 << 10; len(data) > 0; data = data[chunk:] {
		if chunk > len(data) {
			chunk = len(data)
		}
		send(&pb.UploadImagesRequest{Part: &pb.UploadImagesRequest_Chunk{Chunk: data[:chunk]}})
	}
	send(&pb.UploadImagesRequest{Part: &pb.UploadImagesRequest_End{End: &pb.UploadEnd{Files: 1}}})
	_, err = stream.CloseAndRecv()
	return err
}

// uploadAll uploads the photos. Each has a stream of its own, so that those that the service cannot
// read are left out.
func uploadAll(jobs pb.ReconstructionServiceClient, job string, photos []string) error {
	for _, photo := range photos {
		err := persistently(func() error { return upload(jobs, job, photo) })
		reason, _ := detailOf(err)
		if strings.HasPrefix(reason, "IMAGE_") || reason == "FILE_EMPTY" {
			log.Println(filepath.Base(photo), "is left out:", status.Convert(err).Message())
		} else if err != nil {
			return err
		}
	}
	return nil
}

// submit uploads the photos and starts the job. A job that does not run is deleted: nobody goes on
// with it.
func submit(jobs pb.ReconstructionServiceClient, job string, photos []string) {
	err := uploadAll(jobs, job, photos)
	if err == nil {
		_, err = jobs.StartJob(ctx, &pb.StartJobRequest{Name: job, RequestId: newID()})
		// Else the service refused it: errors of servers that are away or busy have a reason, too.
		if reason, _ := detailOf(err); err != nil && (reason == "" || mayRetry(err)) {
			log.Println(job, "may have been started; see: litags watch", job)
			must(job, err)
		}
	}
	if err == nil {
		return
	}
	if _, gone := jobs.DeleteJob(ctx, &pb.DeleteJobRequest{Name: job, AllowMissing: true}); gone != nil {
		log.Println(job, "is left there, not started; remove it with: litags delete", job)
	}
	must(job, err)
}

// watch follows the job to its end; a broken connection goes on after the last event that came.
func watch(jobs pb.ReconstructionServiceClient, job string) *pb.Job {
	for last, failures := int64(0), 0; ; time.Sleep(time.Second) {
		events, err := jobs.WatchJob(ctx, &pb.WatchJobRequest{Name: job, AfterEvent: last})
		for err == nil {
			var event *pb.JobEvent
			if event, err = events.Recv(); err == nil {
				last, failures = event.Number, 0
				if change := event.GetStateChange(); change != nil {
					fmt.Println(change.State, change.Message)
				}
			}
		}
		if err == io.EOF {
			return must(jobs.GetJob(ctx, &pb.GetJobRequest{Name: job}))
		}
		if failures++; !mayRetry(err) || failures > 60 {
			must(job, err)
		}
	}
}

func export(models pb.ModelServiceClient, job string) (data []byte, err error) {
	err = persistently(func() error {
		data = nil
		parts, err := models.ExportModel(ctx, &pb.ExportModelRequest{Name: job})
		for err == nil {
			var part *pb.ExportModelResponse
			if part, err = parts.Recv(); err == nil {
				data = append(data, part.GetChunk()...)
			}
		}
		if err == io.EOF {
			return nil
		}
		return err
	})
	return data, err
}

func main() {
	log.SetFlags(0)
	if len(os.Args) < 4 {
		log.Fatalln("give PHOTOS VIEW.png SCENE.ply [ITERATIONS]")
	}
	folder, picture, scene := os.Args[1], os.Args[2], os.Args[3]
	if !strings.HasSuffix(strings.ToLower(scene), ".ply") {
		log.Fatalf("%s: this program writes PLY only; name it .ply", scene)
	}
	for _, file := range []string{picture, scene} {
		must(os.Stat(filepath.Dir(file)))
	}
	options := &pb.JobOptions{} // what is not set is the server's default
	if len(os.Args) > 4 {
		options.Iterations = proto.Int32(int32(must(strconv.Atoi(os.Args[4]))))
	}
	var photos []string
	for _, file := range must(os.ReadDir(folder)) {
		// Hidden ones, as a Mac's ._0001.jpg, are no photos.
		if regexp.MustCompile(`(?i)^[^.].*\.(jpe?g|png)$`).MatchString(file.Name()) {
			photos = append(photos, filepath.Join(folder, file.Name()))
		}
	}
	channel := connect()
	jobs := pb.NewReconstructionServiceClient(channel)

	job := must(jobs.CreateJob(ctx,
		&pb.CreateJobRequest{RequestId: newID(), Options: options})).Name
	submit(jobs, job, photos)
	fmt.Println(job) // goes on whatever becomes of this program: litags watch
	if done := watch(jobs, job); done.State != pb.JobState_JOB_STATE_SUCCEEDED {
		log.Fatalln(job, done.State, done.Error)
	}

	pictures := pb.NewRenderServiceClient(channel)
	placed := must(pictures.ListCameras(ctx, &pb.ListCamerasRequest{Name: job})).Cameras
	pose := &pb.Pose{Pose: &pb.Pose_Camera{Camera: placed[0].Name}}
	view := must(pictures.RenderView(ctx, &pb.RenderViewRequest{Name: job, Pose: pose}))
	must(picture, os.WriteFile(picture, view.Data, 0o644))
	data, err := export(pb.NewModelServiceClient(channel), job)
	must(data, err)
	must(scene, os.WriteFile(scene, data, 0o644))
}
