startTheme();
startRecord();
startTable();
startPictures();
startPlots();
startAnswers();
startFoot();
document.documentElement.dataset.ready = 'yes';
